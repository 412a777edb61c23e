//! What of the firmware is arithmetic and not hardware: tested on the machine that builds it, because the
//! emulator has no watchdog, no reset causes and no clock tree to try it on.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod feeding;
pub mod rates;
pub mod restart;
pub mod timeline;
