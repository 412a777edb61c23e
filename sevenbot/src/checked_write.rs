//! Writes that are verified: which registers did not take the value, and why.
//!
//! The arm does not answer a write (D6). So the registers are read back. The register table and the status block
//! give the reason for a difference.

use std::fmt;

use protocol_core::registers::map::{
    EEPROM_LOCK, FEEDBACK_FREQUENCY, MOTOR_STATE, PRESENT_POSITION, motor_state, refusal,
};
use protocol_core::registers::map21::find_readable;
use protocol_core::registers::{Access, Region, Register};

use crate::arm::Arm;
use crate::error::Error;
use crate::identity::Firmware;
use crate::map_view::MapView;
use crate::names::name_of_register;
use crate::register_text;
use crate::snapshot::Snapshot;
use crate::span::Span;
use crate::status_block::StatusBlock;

/// A register that does not hold what was written to it.
///
/// ```
/// use sevenbot::checked_write::{MismatchCause, WriteMismatch};
///
/// let refused = WriteMismatch { address: 11, wanted: 42, found: 0, cause: MismatchCause::Locked };
/// assert_eq!(refused.to_string(), "device-id is 0, not 42: it is protected by the EEPROM lock");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WriteMismatch {
    /// The register.
    pub address: u8,
    /// The byte that was written.
    pub wanted: u8,
    /// The byte that was read back.
    pub found: u8,
    /// The reason.
    pub cause: MismatchCause,
}

/// Why a register does not hold what was written to it.
///
/// ```
/// use sevenbot::checked_write::MismatchCause;
///
/// assert_eq!(MismatchCause::Locked.to_string(), "it is protected by the EEPROM lock");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MismatchCause {
    /// The table has no register there.
    NoRegister,
    /// The register is read only.
    ReadOnly,
    /// The maker reserves the register.
    Reserved,
    /// The arm's firmware does not have the register.
    NotServed,
    /// A write to any part of a position makes the maker's firmware move the arm, so it was not sent.
    StartsMotion,
    /// The register is a setting, and the EEPROM lock protects it (D15).
    Locked,
    /// A value in the frame was out of range, so the arm ignored the whole frame (D16).
    OutOfRange {
        /// The register with the value that was out of range.
        address: u8,
    },
    /// No joint angles reach the position that a write of map 2.1 asks for (M7).
    OutOfReach,
    /// The settings storage is full until the next restart (D19).
    StorageFull,
    /// The arm received the frame damaged.
    Damaged,
    /// The arm gives no reason: the frame was lost, or the register has changed since.
    Unknown,
}

impl MismatchCause {
    /// Can the same frame succeed when it is sent again?
    #[must_use]
    pub const fn is_transient(self) -> bool {
        matches!(self, Self::Damaged | Self::Unknown)
    }
}

/// A frame is sent this many times before its loss is an error.
const WRITE_ATTEMPTS: u32 = 5;

impl Arm {
    /// Writes registers, reads them back, and returns those that differ. A frame that seems to be lost is sent again,
    /// up to four times.
    ///
    /// ```no_run
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let mut arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
    /// for unchanged in arm.write_checked(sevenbot::map::DEVICE_ID.address, &[42])? {
    ///     println!("{unchanged}"); // device-id is 0, not 42: it is protected by the EEPROM lock
    /// }
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Arm::read`] and [`Arm::write`]. The arm may have taken the values.
    pub fn write_checked(&mut self, address: u8, values: &[u8]) -> Result<Vec<WriteMismatch>, Error> {
        self.write_all_checked(&[(address, values.to_vec())])
    }

    /// As [`Arm::write_checked`], for several frames, sent one after the other. Each is a first address and its values.
    ///
    /// # Errors
    /// As [`Arm::read`] and [`Arm::write`]. The arm may have taken some of the values.
    pub fn write_all_checked(&mut self, writes: &[(u8, Vec<u8>)]) -> Result<Vec<WriteMismatch>, Error> {
        self.with_min_attempts(|arm| arm.write_until_taken(writes))
    }

    fn write_until_taken(&mut self, writes: &[(u8, Vec<u8>)]) -> Result<Vec<WriteMismatch>, Error> {
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
                break;
            }
            (before, sending) = (after, lost);
        }
        Ok(unchanged)
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

    /// Before a write that lets the motors of the maker's firmware drive the joints: makes the present positions the
    /// targets. Ours does that by itself (D13); the maker's drives each joint to its last target.
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
        // The maker's firmware changes a locked setting until the next restart, and does not store it.
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

fn compare(found: &Snapshot, wanted: &[u8], cause: impl Fn(u8, u8) -> MismatchCause) -> Vec<WriteMismatch> {
    let pairs = found.span().addresses().zip(wanted).zip(&found.values);
    pairs
        .filter(|&((address, &wanted), &found)| number(address, wanted) != number(address, found))
        .map(|((address, &wanted), &found)| {
            let cause = cause(address, wanted);
            WriteMismatch { address, wanted, found, cause }
        })
        .collect()
}

/// The number that a byte encodes. Minus zero is zero (D9).
fn number(address: u8, byte: u8) -> i16 {
    find_readable(address).map_or(i16::from(byte), |row| row.range.decode_byte(byte))
}

/// The firmware's reason why no write can change a register; `None` if a write can.
fn cause_from_arm(view: MapView, address: u8) -> Option<MismatchCause> {
    match () {
        () if !view.serves(address) => Some(MismatchCause::NotServed),
        () if view.starts_inverse(address) && !PRESENT_POSITION.holds(address) => {
            Some(MismatchCause::StartsMotion)
        }
        () => None,
    }
}

/// The table's reason why no write can change a register; `None` if a write can.
fn cause_from_access(address: u8, locked: bool) -> Option<MismatchCause> {
    match find_readable(address) {
        None => Some(MismatchCause::NoRegister),
        Some(Register { access: Access::ReadOnly, .. }) => Some(MismatchCause::ReadOnly),
        Some(Register { access: Access::Reserved, .. }) => Some(MismatchCause::Reserved),
        Some(Register { region: Region::Eeprom, .. }) if locked => Some(MismatchCause::Locked),
        Some(_) => None,
    }
}

/// The reason according to the arm's counters before and after the write.
pub(crate) fn cause_from_counters(before: &StatusBlock, after: &StatusBlock) -> MismatchCause {
    let refused = before.frames_refused() != after.frames_refused();
    match after.last_refusal() {
        Some((refusal::OUT_OF_RANGE, address)) if refused => MismatchCause::OutOfRange { address },
        Some((refusal::STORAGE_FULL, _)) if refused => MismatchCause::StorageFull,
        Some((refusal::OUT_OF_REACH, _)) if refused => MismatchCause::OutOfReach,
        _ if before.frames_corrupted() != after.frames_corrupted() => MismatchCause::Damaged,
        _ => MismatchCause::Unknown,
    }
}

/// The reason if the arm has no status block.
fn cause_from_range(address: u8, wanted: u8) -> MismatchCause {
    match find_readable(address) {
        Some(row) if !row.range.contains(wanted.into()) => MismatchCause::OutOfRange { address },
        _ => MismatchCause::Unknown,
    }
}

impl fmt::Display for WriteMismatch {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (found, wanted) = (number(self.address, self.found), number(self.address, self.wanted));
        write!(out, "{} is {found}, not {wanted}: {}", name_of_register(self.address), self.cause)
    }
}

impl fmt::Display for MismatchCause {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoRegister => out.write_str("the table has no register there"),
            Self::ReadOnly => out.write_str("it is read only"),
            Self::Reserved => out.write_str("it is reserved by the maker"),
            Self::NotServed => out.write_str("the arm's firmware does not have it"),
            Self::StartsMotion => out.write_str(
                "not written, because any write there moves an arm of the maker; `sevenbot move-to` moves the tip",
            ),
            Self::Locked => out.write_str("it is protected by the EEPROM lock"),
            Self::OutOfRange { address } => {
                let name = name_of_register(address);
                write!(out, "the arm ignored the frame: {name} takes {}", register_text::range(address))
            }
            Self::OutOfReach => out.write_str("no joint angles reach the position"),
            Self::StorageFull => out.write_str("the settings storage is full until the arm restarts"),
            Self::Damaged => out.write_str("the arm received the request damaged; try again"),
            Self::Unknown => out.write_str("the arm gives no reason; try again"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::{
        DEVICE_ID, FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER, OFFSET, PRESENT_POSITION, RESERVED_8,
        STATUS_VERSION, TARGET_POSITION,
    };

    fn status(refused: u8, why: u8, register: u8) -> StatusBlock {
        let mut status = Snapshot { address: STATUS_VERSION.address, values: vec![0; 16] };
        for (row, value) in
            [(LAST_REFUSAL, why), (LAST_REFUSED_REGISTER, register), (FRAMES_REFUSED, refused)]
        {
            status.values[usize::from(row.address - STATUS_VERSION.address)] = value;
        }
        StatusBlock::from(status)
    }

    #[test]
    fn the_table_gives_the_cause_of_an_impossible_write() {
        assert_eq!(cause_from_access(67, false), Some(MismatchCause::NoRegister));
        assert_eq!(cause_from_access(61, false), None, "of map 2.1");
        assert_eq!(cause_from_access(PRESENT_POSITION.address, false), Some(MismatchCause::ReadOnly));
        assert_eq!(cause_from_access(RESERVED_8.address, false), Some(MismatchCause::Reserved));
        assert_eq!(cause_from_access(DEVICE_ID.address, true), Some(MismatchCause::Locked));
        assert_eq!(cause_from_access(DEVICE_ID.address, false), None);
        assert_eq!(cause_from_access(TARGET_POSITION.address, true), None);
    }

    #[test]
    fn a_new_refusal_gives_the_cause() {
        let before = status(4, refusal::OUT_OF_RANGE, 46);
        let stale = status(4, refusal::OUT_OF_RANGE, 46);
        assert_eq!(
            cause_from_counters(&before, &stale),
            MismatchCause::Unknown,
            "an older refusal explains nothing"
        );
        let after = status(5, refusal::OUT_OF_RANGE, 47);
        assert_eq!(cause_from_counters(&before, &after), MismatchCause::OutOfRange { address: 47 });
        let far = status(5, refusal::OUT_OF_REACH, 68);
        assert_eq!(cause_from_counters(&before, &far), MismatchCause::OutOfReach);
        let full = status(5, refusal::STORAGE_FULL, 11);
        assert_eq!(cause_from_counters(&before, &full), MismatchCause::StorageFull);
    }

    #[test]
    fn without_a_status_block_the_range_gives_the_cause() {
        assert_eq!(cause_from_range(46, 200), MismatchCause::OutOfRange { address: 46 });
        assert_eq!(cause_from_range(46, 90), MismatchCause::Unknown);
    }

    #[test]
    fn minus_zero_equals_zero() {
        let found = Snapshot { address: OFFSET.address, values: vec![0, 0] };
        let unchanged = compare(&found, &[0x80, 0x85], |_, _| MismatchCause::Unknown);
        let [only] = unchanged.as_slice() else { panic!("{unchanged:?}") };
        assert_eq!(only.to_string(), "offset.2 is 0, not -5: the arm gives no reason; try again");
    }
}
