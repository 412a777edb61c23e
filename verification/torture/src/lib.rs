//! Simulations of the whole arm with injected faults.
//!
//! ```text
//!   cli ─▶ CampaignPlan ─▶ campaign ─▶ TortureWorld (one seed, one scenario, an hour) ─▶ WorldCounts or FailedWorld ─┐
//!                                 ├──▶ free_motion: motions with and without protection ─▶ FreeMotionTrial ───────────┤
//!                                 └──▶ parser_trial: good frames on a disturbed line ─▶ ParserTrial ─────────────────┤
//!   cli ─▶ load: a client that saturates a port                                               result_table ◀─────────┘
//!   cli ─▶ sag: how far the arm sags during a failure
//!   cli ─▶ obstacles: falls and pushes of the arm at walls, after alarms and after emergency stops
//!   fuzz: the targets of `verification/fuzz/`, and of the test of its corpora
//! ```
//!
//! [`world`] uses virtual time only: a seed gives the same world on every machine. A violated rule ends the campaign with
//! the seed that reproduces it.

pub mod campaign;
pub mod cli;
pub mod free_motion;
pub mod seeded_rng;
// Fuzz targets report a violated rule by a panic. Only the fuzzer and tests call them.
#[allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)]
pub mod fuzz;
mod linkage_goals;
pub mod load;
pub mod obstacles;
mod panic_handler;
pub mod parser_trial;
pub mod per_joint;
pub mod result_table;
pub mod sag;
pub mod scenario;
// Test code, which reports a failure by a panic. The parts that a campaign uses do not panic.
#[allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)]
mod shared;
pub mod text_table;
pub mod violation;
pub mod world;
pub mod world_counts;
