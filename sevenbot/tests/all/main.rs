//! Tests of the public face of sevenbot, in one program.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod approach;
mod arm;
mod fake;
mod health;
mod simulated;
mod stopping;
mod stream;
