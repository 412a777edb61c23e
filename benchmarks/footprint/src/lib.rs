//! Shared parts of the measuring programs: inputs that the compiler cannot evaluate, and a panic handler, which the programs
//! of `cargo xtask no-panic` must not contain.
//!
//! The programs call parts of the cores, kinematics, or peers of `cargo xtask bench`. Inputs and outputs pass through
//! [`opaque`], so the compiler can neither evaluate nor remove the calls. `xtask` inspects the linked images, and runs those
//! that [count](meter) in the emulator.

#![no_std]

pub mod count_server;
pub mod meter;
pub mod poses;

use core::hint::black_box;
use core::panic::PanicInfo;

use protocol_core::time::Instant;

/// Returns `value`, hidden from the compiler.
pub fn opaque<T>(value: T) -> T {
    black_box(value)
}

/// Bytes whose number and values the compiler does not know.
#[must_use]
pub fn any_bytes() -> &'static [u8] {
    opaque(&[])
}

/// A time that the compiler does not know.
#[must_use]
pub fn any_time() -> Instant {
    Instant::from_micros(opaque(0))
}

/// Linked only if a panic is reachable: `cargo xtask no-panic` searches for it.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    loop {
        opaque(info);
    }
}
