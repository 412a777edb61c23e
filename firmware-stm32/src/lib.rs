//! The library of the firmware and of the self-test image: the drivers of the chip, and the logic that the two need.
//!
//! The logic needs no hardware. Its tests run on the host, because the emulator has no watchdog, no reset causes, no clock
//! tree and no working flash. The drivers are in `chip`, which exists for the chip only.

#![cfg_attr(not(test), no_std)]
#![deny(unsafe_code)]

pub mod bus_pause;
pub mod byte_queue;
#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "access to registers")]
pub mod chip;
pub mod clock_rates;
pub mod crystal;
pub mod flash;
pub mod led_pattern;
pub mod line_errors;
pub mod log_gate;
pub mod question;
pub mod reset_cause;
pub mod serial_line;
pub mod stack_guard;
pub mod tick;
pub mod timeline;
pub mod usart_status;
pub mod vdd;
pub mod wait;
pub mod watchdog_gate;
