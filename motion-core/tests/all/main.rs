//! Tests of the public face of motion-core, in one program.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod blocked_heat;
mod emergency_stop;
mod engaging;
mod extended_block;
mod failing_servos;
mod free_moves;
mod guard_time;
mod holding;
mod host_link;
mod late_calls;
mod linkage;
mod map21;
mod motion;
mod protection;
mod rig;
mod servo_frames;
mod stream_bounds;
mod stream_points;
