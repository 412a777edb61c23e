//! An exercise and its text file.

use serde::Deserialize;

use crate::goal::Goal;
use crate::solution::{SolutionPart, Step, parts};
use crate::text::Text;

/// A longer file is no exercise, in bytes.
const LARGEST: usize = 200_000;

/// An exercise.
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
    /// Its name in the list.
    pub title: Text,
    /// What is to be done.
    pub text: Text,
    /// Shown one after the other, if the learner asks.
    #[serde(default)]
    pub hints: Vec<Text>,
    /// What has to be reached.
    pub goals: Vec<Goal>,
    /// Is a goal reached only after all goals before it?
    #[serde(default)]
    pub in_order: bool,
    /// What happens to the simulated arm at the start, such as `fault 1=wall=120`.
    #[serde(default)]
    pub setup: Vec<String>,
    /// A solution, step by step.
    #[serde(default)]
    solution: Vec<Step>,
}

/// Why a text is no exercise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExerciseError {
    /// The line of the file, from 1; 0 for the file as a whole.
    pub line: usize,
    /// Why, in English.
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
    /// It is no JSON, something is missing or unknown, or a goal can never be reached.
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

    /// The solution; empty if the file has none.
    #[must_use]
    pub fn solution(&self) -> Vec<SolutionPart> {
        parts(&self.solution)
    }
}
