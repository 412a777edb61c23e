//! Tests of the public face of the link, in one program.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic)] // A panic is a failed test.

mod all_registers;
mod common;
mod damage;
mod link;
mod properties;
