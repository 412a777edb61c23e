//! Why a register does not hold what was written to it. The sources are the register table, the firmware, the status block,
//! and a server between the program and the arm.

use std::fmt;

use host_link::sharing::{DrivenBy, SharingState};
use protocol_core::registers::map::{LIMITS, PRESENT_POSITION, refusal};
use protocol_core::registers::map21::find_readable;
use protocol_core::registers::{Access, Region, Register};

use crate::map_view::MapView;
use crate::names::name_of_register;
use crate::register_text;
use crate::status_block::StatusBlock;

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
    /// The table allows no write to the register.
    ReadOnly,
    /// The maker reserves the register.
    Reserved,
    /// The arm's firmware does not have the register.
    NotServed,
    /// A write to any part of a position makes the maker's firmware move the arm, so it was not sent.
    StartsMotion,
    /// The register is a setting, and the EEPROM lock protects it ([D15](protocol_core::decisions#d15)).
    Locked,
    /// A value in the frame was out of range, so the arm ignored the whole frame ([D16](protocol_core::decisions#d16)).
    OutOfRange {
        /// The register with the value that was out of range.
        address: u8,
    },
    /// The frame covered one byte of a two-byte register, so the arm ignored the whole frame
    /// ([D22](protocol_core::decisions#d22)).
    HalfOfWord {
        /// The register, at its low byte.
        address: u8,
    },
    /// A target was against a limit that is switched on, so the arm ignored the whole frame
    /// ([D25](protocol_core::decisions#d25)).
    AgainstLimit {
        /// The target, or the register of the limits if the frame was to switch a limit on.
        address: u8,
    },
    /// No joint angles reach the position that a write of map 2.1 asks for ([M7](protocol_core::decisions#m7)).
    OutOfReach,
    /// The settings storage is full until the next restart ([D19](protocol_core::decisions#d19)).
    StorageFull,
    /// The register holds the value, but its setting may not be stored: the settings storage has a fault or became full
    /// ([D19](protocol_core::decisions#d19)).
    NotStored,
    /// The controller restarted before or after the write, so its RAM registers have the values of its start.
    Restarted,
    /// The arm received the frame damaged.
    Damaged,
    /// A server between the program and the arm did not pass the frame on.
    NotPassedOn(ServerReason),
    /// The arm gives no reason: the frame was lost, or the register has changed since.
    Unknown,
}

impl MismatchCause {
    /// Is it worth sending the same frame again at once?
    #[must_use]
    pub const fn is_transient(self) -> bool {
        matches!(self, Self::Damaged | Self::Unknown)
    }
}

/// Why a server drops writes of a program: all of them, or those that move the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServerReason {
    /// The server was started with `--read-only`.
    ReadOnly,
    /// Another program's stop ended the stream of this program.
    Stopped,
    /// The server lets one program at a time move the arm, and another one moves it now.
    AnotherDrives,
}

impl ServerReason {
    /// `None` if the server passes all writes on.
    pub(super) fn of(state: &SharingState) -> Option<Self> {
        match () {
            () if state.is_read_only => Some(Self::ReadOnly),
            () if state.is_stopped => Some(Self::Stopped),
            () if state.has_one_driver && state.driven_by == DrivenBy::Another => Some(Self::AnotherDrives),
            () => None,
        }
    }
}

/// The firmware's reason why a register is not written: the firmware lacks it, or a write would start a motion. `None` if the
/// firmware has no reason; then [`cause_from_access`] may have one.
pub(super) fn cause_from_arm(view: MapView, address: u8) -> Option<MismatchCause> {
    match () {
        () if !view.serves(address) => Some(MismatchCause::NotServed),
        () if view.starts_inverse(address) && !PRESENT_POSITION.holds(address) => {
            Some(MismatchCause::StartsMotion)
        }
        () => None,
    }
}

/// The table's reason why a write does not change a register; `None` if a write can change it.
pub(super) fn cause_from_access(address: u8, locked: bool) -> Option<MismatchCause> {
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
        _ if after.has_restarted_since(before) => MismatchCause::Restarted,
        Some((refusal::OUT_OF_RANGE, address)) if refused => MismatchCause::OutOfRange { address },
        Some((refusal::STORAGE_FULL, _)) if refused => MismatchCause::StorageFull,
        Some((refusal::HALF_A_WORD, address)) if refused => MismatchCause::HalfOfWord { address },
        Some((refusal::AGAINST_A_LIMIT, address)) if refused => MismatchCause::AgainstLimit { address },
        Some((refusal::OUT_OF_REACH, _)) if refused => MismatchCause::OutOfReach,
        _ if before.frames_corrupted() != after.frames_corrupted() => MismatchCause::Damaged,
        _ => MismatchCause::Unknown,
    }
}

/// The cause as far as the table tells it, for an arm without a status block.
pub(super) fn cause_from_range(address: u8, wanted: u16) -> MismatchCause {
    match find_readable(address) {
        Some(row) if !row.range.contains(wanted) => MismatchCause::OutOfRange { address },
        _ => MismatchCause::Unknown,
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
            Self::HalfOfWord { address } => {
                let name = name_of_register(address);
                write!(out, "the arm ignored the frame: it had only one of the two bytes of {name}")
            }
            Self::AgainstLimit { address } if LIMITS.holds(address) => {
                out.write_str("the arm is against the limit: move it inside before you switch the limit on")
            }
            Self::AgainstLimit { address } => {
                let name = name_of_register(address);
                write!(out, "the arm ignored the frame: {name} is against a limit that is switched on; see `limits`")
            }
            Self::OutOfReach => out.write_str("no joint angles reach the position"),
            Self::StorageFull => out.write_str("the settings storage is full until the arm restarts"),
            Self::NotStored => {
                out.write_str("the settings storage has a fault; switch the arm off and on, then write it again")
            }
            Self::Restarted => out.write_str("the controller restarted, and has the values of its start"),
            Self::Damaged => out.write_str("the arm received the request damaged; try again"),
            Self::NotPassedOn(reason) => reason.fmt(out),
            Self::Unknown => out.write_str("the arm gives no reason; try again"),
        }
    }
}

impl fmt::Display for ServerReason {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::ReadOnly => "the server was started with --read-only: it passes no writes to the arm",
            Self::Stopped => "another program stopped the arm; pause for a second, then try again",
            Self::AnotherDrives => {
                "the server lets one program move the arm at a time, and another one does now"
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_link::Snapshot;
    use protocol_core::registers::map::{
        DEVICE_ID, FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER, RESERVED_8, STATUS_VERSION,
        TARGET_POSITION,
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
        let half = status(5, refusal::HALF_A_WORD, 130);
        let half = cause_from_counters(&before, &half);
        assert_eq!(
            half.to_string(),
            "the arm ignored the frame: it had only one of the two bytes of fine-target.2"
        );
        assert_eq!(half, MismatchCause::HalfOfWord { address: 130 });
        let limit =
            |address| cause_from_counters(&before, &status(5, refusal::AGAINST_A_LIMIT, address)).to_string();
        assert!(limit(47).contains("target-position.2 is against a limit"), "{}", limit(47));
        assert!(limit(188).contains("before you switch the limit on"), "{}", limit(188));
        let full = status(5, refusal::STORAGE_FULL, 11);
        assert_eq!(cause_from_counters(&before, &full), MismatchCause::StorageFull);
    }

    #[test]
    fn without_a_status_block_the_range_gives_the_cause() {
        assert_eq!(cause_from_range(46, 200), MismatchCause::OutOfRange { address: 46 });
        assert_eq!(cause_from_range(46, 90), MismatchCause::Unknown);
    }
}
