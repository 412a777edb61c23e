//! Tests of the public face of kinematics, in one program.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod all_solutions;
mod branches;
mod common;
mod nearest;
mod oracles;
mod round_trip;
mod same_bits;
mod witness;
