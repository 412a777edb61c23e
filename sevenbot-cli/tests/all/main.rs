//! Tests of the built `sevenbot`, in one program.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

#[path = "../../../sevenbot/tests/all/fake/mod.rs"]
mod fake;
mod stopping;
mod unusual_arms;
