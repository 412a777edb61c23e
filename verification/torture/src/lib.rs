//! The whole arm in worlds where everything goes wrong, again and again.
//!
//! ```text
//!   cli ──▶ Plan ──▶ campaign ──▶ World (one seed, one scenario, an hour) ──▶ Tally or Failure ──▶ table
//!                            └──▶ parser: good frames on a disturbed line ──▶ Line ───────────────▶
//!   cli ──▶ load: a client that saturates a port
//!   cli ──▶ sag: how far the arm sags when something fails
//!   fuzz: what the fuzzer tries, for `verification/fuzz/` and for the test of its corpora
//! ```
//!
//! Nothing sleeps and nothing reads a clock in [`world`]: the same seed gives the same world on every machine.
//! A violated rule ends the run with the seed that shows it again.

pub mod campaign;
pub mod cli;
pub mod dice;
// A panic is how these say that something does not hold; nothing but the fuzzer and tests calls them.
#[allow(clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)]
pub mod fuzz;
pub mod load;
pub mod parser;
pub mod per_joint;
pub mod sag;
pub mod scenario;
// Written for tests, where a panic is how a failure is told. What of it runs in a campaign has none to tell.
#[allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)]
mod shared;
pub mod table;
pub mod tally;
pub mod violation;
pub mod world;
