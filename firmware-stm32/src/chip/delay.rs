//! Busy waiting, for delays too short to sleep through.

use super::clock::micros;

/// Returns after `duration` microseconds.
pub fn delay_micros(duration: u32) {
    let start = micros();
    while micros().wrapping_sub(start) < duration {}
}
