//! Position reports during a task. Afterwards registers 53 and 189 have their old values again.

use protocol_core::registers::map::{FEEDBACK_FREQUENCY, REPORT_CONTENT, report_content};

use super::error::{ConnectionLost, MoveError};
use crate::arm::Arm;
use crate::error::Error;
use host_link::Span;

/// How many times an unconfirmed write is sent. On a line that loses 3 % of its bytes, at least one of them arrives in
/// 99 of 100 cases.
const BLIND_WRITES: usize = 3;

impl Arm {
    /// The value of register 189 for the most exact positions that this arm reports.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn exact_positions(&mut self) -> Result<u8, Error> {
        let has_block = self.has_extended_block()?;
        Ok(if has_block { report_content::FINE_POSITIONS } else { report_content::POSITIONS })
    }

    /// Runs `work` while the arm sends `hz` reports a second, or fewer on a slow line. `content` is the value of register 189 for
    /// them. Restores registers 53 and 189 afterwards, also after a failure of `work`.
    ///
    /// # Errors
    /// Those of `work`, and of [`Arm::write_checked`].
    pub fn with_reports<T, E: ConnectionLost + From<MoveError>>(
        &mut self,
        hz: u8,
        content: u8,
        work: impl FnOnce(&mut Self) -> Result<T, E>,
    ) -> Result<T, E> {
        let before = self.start_reports(hz, content)?;
        let done = work(self);
        // Without a connection no answer confirms a write, so each is sent several times.
        if done.as_ref().is_err_and(E::is_connection_lost) {
            for (address, values) in [&before; BLIND_WRITES].into_iter().flatten() {
                let _ = self.write(*address, values);
            }
            return done;
        }
        let restored = self.write_all_checked(&before);
        let done = done?;
        restored.map_err(MoveError::from)?;
        Ok(done)
    }

    /// Starts reports. Returns the registers to restore.
    fn start_reports(&mut self, hz: u8, content: u8) -> Result<Vec<(u8, Vec<u8>)>, MoveError> {
        let mut rows = vec![(FEEDBACK_FREQUENCY, hz)];
        if self.has_extended_block()? {
            // Write the content first, so that no report at this frequency has another content.
            rows.insert(0, (REPORT_CONTENT, content));
        }
        let mut before = Vec::new();
        for (row, _) in &rows {
            before.push((row.address, vec![self.read_span(Span::of(row))?.byte(row)]));
        }
        let wanted: Vec<_> = rows.iter().map(|(row, value)| (row.address, vec![*value])).collect();
        self.write_all_checked(&wanted)?;
        Ok(before)
    }
}
