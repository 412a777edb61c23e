//! Reports for the time of some work; the frequency is afterwards what it was before (register 53).

use sevenbot::map::FEEDBACK_FREQUENCY;
use sevenbot::{Arm, Span};

use crate::command_error::CommandError;
use crate::write_result::all_taken;

/// Does work while the arm reports its positions so many times a second.
pub(crate) fn with_reports<T>(
    arm: &mut Arm,
    hz: u8,
    work: impl FnOnce(&mut Arm) -> Result<T, CommandError>,
) -> Result<T, CommandError> {
    let before = arm.read_span(Span::of(&FEEDBACK_FREQUENCY))?.byte(&FEEDBACK_FREQUENCY);
    all_taken(&arm.write_checked(FEEDBACK_FREQUENCY.address, &[hz])?)?;
    let done = work(arm);
    // An arm that went away cannot be told anything.
    if done.as_ref().is_err_and(CommandError::is_connection_lost) {
        return done;
    }
    let restored = arm.write_checked(FEEDBACK_FREQUENCY.address, &[before]);
    let done = done?;
    all_taken(&restored?)?;
    Ok(done)
}
