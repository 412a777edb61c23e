//! Busy waiting, for delays too short to sleep through.

use crate::clock::micros;

/// Returns after `duration` microseconds.
pub(crate) fn delay_micros(duration: u32) {
    let start = micros();
    while micros().wrapping_sub(start) < duration {}
}
