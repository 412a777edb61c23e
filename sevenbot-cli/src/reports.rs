//! Position reports during a task. Afterwards registers 53 and 189 have their old values again.

use sevenbot::map::{FEEDBACK_FREQUENCY, REPORT_CONTENT, report_content};
use sevenbot::{Arm, Span};

use crate::command_error::CommandError;
use crate::write_result::all_taken;

/// The most exact positions that this arm reports: a value of register 189.
pub(crate) fn exact_positions(arm: &mut Arm) -> Result<u8, CommandError> {
    let has_block = arm.has_extended_block()?;
    Ok(if has_block { report_content::FINE_POSITIONS } else { report_content::POSITIONS })
}

/// Runs `work` while the arm reports `hz` times a second what `content` asks for: a value of register 189.
pub(crate) fn with_reports<T>(
    arm: &mut Arm,
    hz: u8,
    content: u8,
    work: impl FnOnce(&mut Arm) -> Result<T, CommandError>,
) -> Result<T, CommandError> {
    let mut rows = vec![(FEEDBACK_FREQUENCY, hz)];
    if arm.has_extended_block()? {
        // The content first: no report of another content is sent at this frequency.
        rows.insert(0, (REPORT_CONTENT, content));
    }
    let mut before = Vec::new();
    for (row, _) in &rows {
        before.push((row.address, vec![arm.read_span(Span::of(row))?.byte(row)]));
    }
    let wanted: Vec<_> = rows.iter().map(|(row, value)| (row.address, vec![*value])).collect();
    all_taken(&arm.write_all_checked(&wanted)?)?;
    let done = work(arm);
    // Without a connection the registers cannot be restored.
    if done.as_ref().is_err_and(CommandError::is_connection_lost) {
        return done;
    }
    let restored = arm.write_all_checked(&before);
    let done = done?;
    all_taken(&restored?)?;
    Ok(done)
}

/// The failure of an arm that has stopped reporting, although the connection works.
pub(crate) fn reports_stopped() -> CommandError {
    CommandError::Arm("the arm has stopped reporting its positions: was it switched off and on?".to_owned())
}
