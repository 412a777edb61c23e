//! The drivers of the chip: registers, interrupts, and the handlers of crashes. `board.rs` is the table of the pins.
//!
//! Firmware and self-test image link the same drivers, but only the self-test reads the ADC, and only the firmware writes the
//! flash. The drivers of what the emulator has are tested there. The other files of the library are logic, tested on the host.

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
