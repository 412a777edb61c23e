//! Puts registers back after a task, also over a line that loses most frames.

use super::{MismatchCause, NotTaken, WriteError, compare};
use crate::arm::Arm;
use crate::error::Error;
use host_link::Snapshot;

/// Each attempt is a write and a read. On a line that loses 3 % of its bytes, each of the two succeeds about every second time.
const ATTEMPTS: u32 = 6;

impl Arm {
    /// Writes the values of `before`, and reads them back. Unlike [`Arm::write_checked`], it reads no other registers, and writes
    /// again if an answer is missing. On a silent line it takes six times the timeout of a reply.
    ///
    /// # Errors
    /// The last attempt read other values or got no answer. Or the port failed.
    pub(crate) fn put_back(&mut self, before: &Snapshot) -> Result<(), WriteError> {
        self.with_attempts(1, |arm| {
            let mut done = Ok(());
            for _ in 0..ATTEMPTS {
                arm.write(before.address, &before.values)?;
                done = match arm.read_span(before.span()) {
                    Ok(found) => {
                        let differing = compare(&found, &before.values, |_, _| MismatchCause::Unknown);
                        NotTaken::check(differing).map_err(WriteError::from)
                    }
                    Err(error @ Error::NoAnswer { .. }) => Err(error.into()),
                    Err(error) => return Err(error.into()),
                };
                if done.is_ok() {
                    break;
                }
            }
            done
        })
    }
}
