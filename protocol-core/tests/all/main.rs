//! Tests of the public face of protocol-core, in one program, so that only one is linked.

#![allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod damage;
mod disturbed_line;
mod framing;
mod golden_frames;
mod golden_frames_21;
mod journal_faults;
mod journal_use;
mod journal_world;
mod power_loss;
mod register_rules;
mod register_rules_21;
mod silence;
mod stream;
