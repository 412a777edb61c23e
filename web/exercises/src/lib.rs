//! Exercises for learners: without a browser, an arm, input or output, or a clock.
//!
//! ```text
//!   text file ──▶ Exercise ──▶ Attempt ◀── Observation: what the arm measures, some times a second
//!                    │            └──▶ the goals that are reached
//!                    └──▶ SolutionPart: a program of blocks, or an obstacle taken away
//! ```

#![forbid(unsafe_code)]

mod attempt;
mod exercise;
mod goal;
mod path;
mod shipped;
mod solution;
mod text;

pub use attempt::{Attempt, Observation, SeenThing};
pub use exercise::{Exercise, ExerciseError};
pub use goal::Goal;
pub use shipped::shipped;
pub use solution::SolutionPart;
pub use text::Text;
