//! What of the firmware is arithmetic and not hardware: tested on the machine that builds it, because the
//! emulator has no watchdog, no reset causes, no clock tree and no flash to try it on.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod feeding;
pub mod flash;
pub mod rates;
pub mod restart;
pub mod timeline;
