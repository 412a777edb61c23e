//! The drivers of the chip: registers, interrupts, and the handlers of crashes. `board.rs` is the table of the pins.
//!
//! Firmware and self-test image link the same drivers. The drivers are tested in the emulator. Logic that has a file of its
//! own outside this folder is tested on the host.

pub mod adc;
pub mod board;
pub mod clock;
pub mod crash;
pub mod delay;
pub mod flash_registers;
pub mod gpio;
pub mod host_link;
pub mod mpu;
pub mod outputs;
pub mod servo_link;
pub mod uart;
pub mod watchdog;
