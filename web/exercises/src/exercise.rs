//! An exercise and its text file.

use serde::Deserialize;

use crate::goal::Goal;
use crate::solution::{SolutionPart, SolutionStep, parts};
use crate::text::Text;

/// The largest file of an exercise, in bytes.
const LARGEST: usize = 200_000;

/// A task for a learner, with goals that a program can check.
///
/// ```
/// use exercises::Exercise;
///
/// let text = r#"{"title": "Turn", "text": "Turn the base.", "goals": [{"text": "at 120", "joint": 1, "degrees": 120}]}"#;
/// let exercise = Exercise::parse(text)?;
/// assert_eq!((exercise.title.of("en"), exercise.goals.len()), ("Turn", 1));
/// # Ok::<(), exercises::ExerciseError>(())
/// ```
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exercise {
    /// Its title in the list of exercises.
    pub title: Text,
    /// The task, for the learner.
    pub text: Text,
    /// The hints, in the order in which the learner sees them: one more at each request.
    #[serde(default)]
    pub hints: Vec<Text>,
    /// The goals. An exercise has at least one.
    pub goals: Vec<Goal>,
    /// Must the goals be reached in their order?
    #[serde(default)]
    pub in_order: bool,
    /// Actions on the simulated arm at the start, such as `fault 1=wall=120`. An exercise with actions needs a simulated arm.
    #[serde(default)]
    pub setup: Vec<String>,
    /// The steps of a solution; empty if the file has none.
    #[serde(default)]
    solution: Vec<SolutionStep>,
}

/// The reason why a text is no valid exercise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExerciseError {
    /// The line of the file, from 1; 0 if it is not known.
    pub line: usize,
    /// The reason, in English.
    pub reason: String,
}

impl std::fmt::Display for ExerciseError {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.line > 0 {
            write!(out, "line {}: ", self.line)?;
        }
        out.write_str(&self.reason)
    }
}

impl std::error::Error for ExerciseError {}

impl Exercise {
    /// Parses the file of an exercise.
    ///
    /// # Errors
    /// The text is longer than 200,000 bytes or no JSON, a member is missing, unknown or invalid, there is no goal, or a number
    /// of a goal is out of its range.
    pub fn parse(text: &str) -> Result<Self, ExerciseError> {
        let whole = |reason: &str| ExerciseError { line: 0, reason: reason.to_owned() };
        if text.len() > LARGEST {
            return Err(whole("the file is too long for an exercise"));
        }
        let exercise: Self = serde_json::from_str(text)
            .map_err(|error| ExerciseError { line: error.line(), reason: error.to_string() })?;
        if exercise.goals.is_empty() {
            return Err(whole("an exercise needs at least one goal"));
        }
        match exercise.goals.iter().zip(1..).find_map(|(goal, number)| Some((number, goal.fault()?))) {
            Some((number, fault)) => Err(whole(&format!("goal {number}: {fault}"))),
            None => Ok(exercise),
        }
    }

    /// The solution as programs of blocks; empty if the file has none.
    #[must_use]
    pub fn solution(&self) -> Vec<SolutionPart> {
        parts(&self.solution)
    }
}
