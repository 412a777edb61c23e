//! One file a command. Each takes an open arm, its arguments and where to write.

pub(crate) mod get;
pub(crate) mod info;
pub(crate) mod monitor;
pub(crate) mod pose;
pub(crate) mod set;

use sevenbot::change::Unchanged;

use crate::failure::Failure;

/// A command that wanted these registers changed fails with the reasons of those that are not.
fn all_taken(unchanged: &[Unchanged]) -> Result<(), Failure> {
    if unchanged.is_empty() {
        return Ok(());
    }
    let reasons: Vec<String> = unchanged.iter().map(ToString::to_string).collect();
    Err(Failure::Arm(reasons.join("\n       ")))
}
