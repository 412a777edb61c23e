//! Position reports during a task. Afterwards register 53 has its old value again.

use sevenbot::map::FEEDBACK_FREQUENCY;
use sevenbot::{Arm, Span};

use crate::command_error::CommandError;
use crate::write_result::all_taken;

/// Runs `work` while the arm reports its positions `hz` times a second.
pub(crate) fn with_reports<T>(
    arm: &mut Arm,
    hz: u8,
    work: impl FnOnce(&mut Arm) -> Result<T, CommandError>,
) -> Result<T, CommandError> {
    let before = arm.read_span(Span::of(&FEEDBACK_FREQUENCY))?.byte(&FEEDBACK_FREQUENCY);
    all_taken(&arm.write_checked(FEEDBACK_FREQUENCY.address, &[hz])?)?;
    let done = work(arm);
    // Without a connection the frequency cannot be restored.
    if done.as_ref().is_err_and(CommandError::is_connection_lost) {
        return done;
    }
    let restored = arm.write_checked(FEEDBACK_FREQUENCY.address, &[before]);
    let done = done?;
    all_taken(&restored?)?;
    Ok(done)
}

/// The failure of an arm that has stopped reporting, although the connection works.
pub(crate) fn reports_stopped() -> CommandError {
    CommandError::Arm("the arm has stopped reporting its positions: was it switched off and on?".to_owned())
}
