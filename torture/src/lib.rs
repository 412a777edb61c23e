//! The whole arm in worlds where everything goes wrong, again and again.
//!
//! ```text
//!   cli ──▶ Plan ──▶ campaign ──▶ World (one seed, one scenario, an hour) ──▶ Tally or Failure ──▶ table
//!                            └──▶ parser: good frames on a disturbed line ──▶ Line ───────────────▶
//!   cli ──▶ load: a client that saturates a port
//! ```
//!
//! Nothing sleeps and nothing reads a clock in [`world`]: the same seed gives the same world on every machine.
//! A violated rule ends the run with the seed that shows it again.

pub mod campaign;
pub mod cli;
pub mod dice;
pub mod load;
pub mod parser;
pub mod per_joint;
pub mod scenario;
pub mod table;
pub mod tally;
pub mod violation;
pub mod world;
