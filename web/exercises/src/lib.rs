//! Exercises for learners. This crate needs no browser, arm or clock, and does no input or output.
//!
//! ```text
//!   text file ──▶ Exercise ──▶ Attempt ◀── Situation: what the arm measures, several times a second
//!                    │            └──▶ the goals that are reached
//!                    └──▶ SolutionPart: a program of blocks, or the removal of obstacles
//! ```

#![forbid(unsafe_code)]

mod attempt;
mod exercise;
mod goal;
mod path;
mod shipped;
mod solution;
mod text;

pub use attempt::{Attempt, SeenThing, Situation};
pub use exercise::{Exercise, ExerciseError};
pub use goal::Goal;
pub use shipped::shipped;
pub use solution::SolutionPart;
pub use text::Text;
