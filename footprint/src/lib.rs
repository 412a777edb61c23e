//! What the measuring programs share: inputs that the compiler knows nothing about, and the panic handler
//! that must not be linked.
//!
//! Each program calls one part of the cores the way a shell does. Whatever goes in and comes out passes
//! through [`opaque`], so that nothing can be worked out in advance, left out, or proved away on account of
//! what this package happens to call. None of them does anything useful: they are linked, and looked at;
//! those that [count](meter) are run in an emulator.

#![no_std]

pub mod contest;
pub mod meter;

use core::hint::black_box;
use core::panic::PanicInfo;

use protocol_core::time::Instant;

/// The value, as something that could be anything from now on.
pub fn opaque<T>(value: T) -> T {
    black_box(value)
}

/// Any bytes, any number of them.
#[must_use]
pub fn any_bytes() -> &'static [u8] {
    opaque(&[])
}

/// Any time.
#[must_use]
pub fn any_time() -> Instant {
    Instant::from_micros(opaque(0))
}

/// Linked only if a panic can be reached: `cargo xtask no-panic` looks for it.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    loop {
        opaque(info);
    }
}
