//! Writes that are verified: which registers did not take the value, and why.
//!
//! The arm does not answer a write ([D6](protocol_core::decisions#d6)). So the registers are read back. The register
//! table and the status block give the reason for a difference.

use protocol_core::registers::map::{EEPROM_LOCK, FEEDBACK_FREQUENCY, MOTOR_STATE, motor_state};
use protocol_core::registers::map21::find_readable;

use crate::arm::Arm;
use crate::error::Error;
use crate::identity::Firmware;
use crate::status_block::StatusBlock;
use host_link::{Snapshot, Span};

mod cause;
mod mismatch;
mod put_back;
mod server;
mod storage;

pub(crate) use cause::cause_from_counters;
pub use cause::{MismatchCause, ServerReason};
use cause::{cause_from_access, cause_from_arm, cause_from_range};
use mismatch::number;
pub use mismatch::{NotTaken, WriteError, WriteMismatch, reasons};
use storage::not_stored;

/// A frame is sent this many times before its loss is an error.
const WRITE_ATTEMPTS: u32 = 5;

impl Arm {
    /// Writes registers, and reads them back. Sends a frame that seems to be lost again, up to four times.
    ///
    /// Before a write that makes the maker's firmware drive the joints, also makes the present positions the targets.
    ///
    /// ```
    /// use sevenbot::checked_write::WriteError;
    /// use sevenbot::simulated::{self, SimulationConfig};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let (mut arm, _) = simulated::arm(SimulationConfig::default())?;
    /// let refused = arm.write_checked(sevenbot::map::DEVICE_ID.address, &[42]);
    /// assert!(matches!(refused, Err(WriteError::NotTaken(locked)) if locked.is_locked()));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`WriteError::NotTaken`] with each register that differs or is not stored, and why. Or the errors of [`Arm::read`] and
    /// [`Arm::write`].
    pub fn write_checked(&mut self, address: u8, values: &[u8]) -> Result<(), WriteError> {
        self.write_all_checked(&[(address, values.to_vec())])
    }

    /// As [`Arm::write_checked`], for several frames, sent one after the other. Each is a first address and its values.
    ///
    /// # Errors
    /// As [`Arm::write_checked`]. The arm may have taken some of the values.
    pub fn write_all_checked(&mut self, writes: &[(u8, Vec<u8>)]) -> Result<(), WriteError> {
        self.with_min_attempts(|arm| arm.write_until_taken(writes))
    }

    /// Runs `work` with the EEPROM lock open. Closes the lock afterwards, also after a failure of `work`.
    ///
    /// A restart of the controller meanwhile closes the lock. Then the error names the restart as the cause, not the lock:
    ///
    /// ```
    /// use sevenbot::map::DEVICE_ID;
    /// use sevenbot::simulated::{self, SimulationConfig};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let (mut arm, simulation) = simulated::arm(SimulationConfig::default())?;
    /// for _ in 0..50 {
    ///     arm.status()?;
    /// }
    /// let failed = arm.with_open_lock(|arm| {
    ///     simulation.with(|simulation| simulation.restart_controller());
    ///     arm.write_checked(DEVICE_ID.address, &[7])
    /// });
    /// assert!(failed.is_err_and(|error| error.to_string().contains("the controller restarted")));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of `work`, and those of [`Arm::write_checked`] if the lock does not open or close.
    pub fn with_open_lock<T>(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<T, WriteError>,
    ) -> Result<T, WriteError> {
        let before = self.status()?;
        if let Err(why) = self.write_checked(EEPROM_LOCK.address, &[0]) {
            // The lock may be open: only the reply may be lost.
            let _ = self.write(EEPROM_LOCK.address, &[1]);
            return Err(why);
        }
        let done = self.told_of_restart(before, work);
        let closed = self.write_checked(EEPROM_LOCK.address, &[1]);
        let done = done?;
        closed?;
        Ok(done)
    }

    /// Runs `work`. If the controller restarted meanwhile, the restart is the cause for all registers that did not take their
    /// values.
    fn told_of_restart<T>(
        &mut self,
        before: Option<StatusBlock>,
        work: impl FnOnce(&mut Self) -> Result<T, WriteError>,
    ) -> Result<T, WriteError> {
        let done = work(self);
        let Err(WriteError::NotTaken(NotTaken(mut lost))) = done else { return done };
        let causes = before.zip(self.status()?).map(|(before, after)| cause_from_counters(&before, &after));
        if causes == Some(MismatchCause::Restarted) {
            lost.iter_mut().for_each(|register| register.cause = MismatchCause::Restarted);
        }
        Err(NotTaken(lost).into())
    }

    fn write_until_taken(&mut self, writes: &[(u8, Vec<u8>)]) -> Result<(), WriteError> {
        let now = self.read_span(Span::between(&EEPROM_LOCK, &FEEDBACK_FREQUENCY))?;
        let locked = now.byte(&EEPROM_LOCK) != 0;
        let reports = self.report_write(writes, now.byte(&FEEDBACK_FREQUENCY));
        self.prepare_torque(writes)?;
        let mut before = self.status()?;
        let (mut unchanged, mut sending) = (Vec::new(), writes.iter().chain(&reports).collect::<Vec<_>>());
        for attempt in 1..=WRITE_ATTEMPTS {
            let found = self.write_and_read_back(&sending, locked)?;
            let after = self.status()?;
            let view = self.view;
            let cause = |address, wanted| {
                cause_from_arm(view, address).or_else(|| cause_from_access(address, locked)).unwrap_or_else(
                    || match (&before, &after) {
                        (Some(before), Some(after)) => cause_from_counters(before, after),
                        _ => cause_from_range(address, wanted),
                    },
                )
            };
            let mut lost = Vec::new();
            for (found, write) in found.iter().zip(sending) {
                let differing = compare(found, &write.1, cause);
                if attempt < WRITE_ATTEMPTS && differing.iter().any(|register| register.cause.is_transient())
                {
                    lost.push(write);
                } else {
                    unchanged.extend(differing);
                }
            }
            if lost.is_empty() {
                if unchanged.is_empty() {
                    unchanged = not_stored(writes, after.as_ref());
                }
                break;
            }
            (before, sending) = (after, lost);
        }
        NotTaken::check(unchanged).map_err(|lost| self.explained_by_server(lost).into())
    }

    /// The write that starts the reports of map 2.2 again, if these writes end them.
    fn report_write(&self, writes: &[(u8, Vec<u8>)], hertz: u8) -> Option<(u8, Vec<u8>)> {
        let ends = writes.iter().any(|(address, values)| self.view.ends_reports(*address, values));
        let row = FEEDBACK_FREQUENCY;
        let is_written = writes.iter().any(|(address, values)| {
            row.address.checked_sub(*address).is_some_and(|index| usize::from(index) < values.len())
        });
        (ends && hertz != 0 && !is_written).then(|| (row.address, vec![hertz]))
    }

    /// Makes the present positions the targets before a write that makes the maker's firmware drive the joints. Otherwise
    /// that firmware would drive each joint to its last target. Our firmware sets the targets itself (D13).
    fn prepare_torque(&mut self, writes: &[(u8, Vec<u8>)]) -> Result<(), Error> {
        let new_state = |(address, values): &(u8, Vec<u8>)| {
            values.get(usize::from(MOTOR_STATE.address.checked_sub(*address)?)).copied()
        };
        let will_drive = writes.iter().any(|write| new_state(write) == Some(motor_state::SERVO));
        if self.identity().firmware() == Firmware::Makers && will_drive && !self.joints()?.is_driven() {
            let positions = self.positions()?;
            self.set_targets(positions)?;
        }
        Ok(())
    }

    fn write_and_read_back(
        &mut self,
        writes: &[&(u8, Vec<u8>)],
        locked: bool,
    ) -> Result<Vec<Snapshot>, Error> {
        // While the lock is closed, the maker's firmware takes a setting but does not store it. So do not send the setting.
        let skips_settings = locked && self.identity().firmware() == Firmware::Makers;
        for (address, values) in writes {
            if !(skips_settings && cause_from_access(*address, locked) == Some(MismatchCause::Locked)) {
                self.write(*address, values)?;
            }
        }
        let read_back = |(address, values): &&(u8, Vec<u8>)| {
            let count = u8::try_from(values.len()).unwrap_or(u8::MAX);
            self.read(*address, count).map(|values| Snapshot { address: *address, values })
        };
        writes.iter().map(read_back).collect()
    }
}

/// The values that differ. Both bytes of a two-byte register are one value (D22).
fn compare(found: &Snapshot, wanted: &[u8], cause: impl Fn(u8, u16) -> MismatchCause) -> Vec<WriteMismatch> {
    let written = Snapshot { address: found.address, values: wanted.to_vec() };
    let values = raw_values(&written).into_iter().zip(raw_values(found));
    values
        .filter(|((address, wanted), (_, found))| number(*address, *wanted) != number(*address, *found))
        .map(|((address, wanted), (_, found))| {
            let cause = cause(address, wanted);
            WriteMismatch { address, wanted, found, cause }
        })
        .collect()
}

/// The raw values of a snapshot with their addresses. A two-byte register is one value, unless the snapshot begins or ends
/// in its middle.
fn raw_values(snapshot: &Snapshot) -> Vec<(u8, u16)> {
    let mut values = Vec::new();
    let mut addresses = snapshot.span().addresses().peekable();
    while let Some(address) = addresses.next() {
        let is_low = find_readable(address)
            .is_some_and(|row| row.range.width() == 2 && address.wrapping_sub(row.address).is_multiple_of(2));
        let is_whole = is_low && addresses.next_if(|next| *next == address.wrapping_add(1)).is_some();
        values.push((address, if is_whole { snapshot.word(address) } else { snapshot.at(address).into() }));
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::{FINE_TARGET, OFFSET};

    #[test]
    fn minus_zero_equals_zero() {
        let found = Snapshot { address: OFFSET.address, values: vec![0, 0] };
        let unchanged = compare(&found, &[0x80, 0x85], |_, _| MismatchCause::Unknown);
        let [only] = unchanged.as_slice() else { panic!("{unchanged:?}") };
        assert_eq!(only.to_string(), "offset.2 is 0, not -5: the arm gives no reason; try again");
    }

    #[test]
    fn d22_both_bytes_of_a_word_are_one_value() {
        let found = Snapshot { address: FINE_TARGET.address, values: vec![0x28, 0x23, 0x28, 0x23, 0x28] };
        let unchanged = compare(&found, &[0x28, 0x23, 0x29, 0x24, 0x28], |_, _| MismatchCause::Unknown);
        let [only] = unchanged.as_slice() else { panic!("{unchanged:?}") };
        assert_eq!((only.address, only.wanted, only.found), (130, 0x2429, 9000));
        assert_eq!(only.to_string(), "fine-target.2 is 9000, not 9257: the arm gives no reason; try again");
    }
}
