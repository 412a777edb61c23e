//! The part of the firmware that needs no hardware. Its tests run on the host, because the emulator has no watchdog, no
//! reset causes, no clock tree and no working flash.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod bus_pause;
pub mod byte_queue;
pub mod clock_rates;
pub mod flash;
pub mod led_pattern;
pub mod line_errors;
pub mod question;
pub mod reset_cause;
pub mod stack_guard;
pub mod tick;
pub mod timeline;
pub mod vdd;
pub mod wait;
pub mod watchdog_gate;
