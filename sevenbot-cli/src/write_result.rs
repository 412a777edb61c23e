//! Notes to the user about new settings.

use sevenbot::map::{BAUD_RATE, OFFSET};
use sevenbot::{Arm, Firmware};

use crate::printer::note;

/// Says which of these new settings act only after a restart of the arm.
pub(crate) fn note_restart(arm: &Arm, mut changed: impl Iterator<Item = u8> + Clone) {
    if changed.clone().any(|address| BAUD_RATE.holds(address)) {
        note("the new baud rate is in force after the next restart of the arm");
    }
    if uses_offsets_after_restart(arm) && changed.any(|address| OFFSET.holds(address)) {
        note("the maker's firmware uses new offsets after its next restart");
    }
}

/// Do new offsets act only after a restart? In this project's firmware they act at once (D9).
pub(crate) fn uses_offsets_after_restart(arm: &Arm) -> bool {
    arm.identity().firmware() == Firmware::Makers
}
