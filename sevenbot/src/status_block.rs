//! The status block, registers 240 to 255 (docs/protocol.md, section 6).

use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    FAULTS, FRAMES_ACCEPTED, FRAMES_CORRUPTED, FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER,
    MISSING_SERVOS, MOVING_JOINTS, SERVO_BUS_ERRORS, SERVO_TEMPERATURE, SUPPLY_VOLTAGE, refusal,
};

use crate::arm::{Arm, STATUS};
use crate::error::Error;
use host_link::Snapshot;

/// The status block at one instant.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
/// match arm.status()? {
///     Some(status) if status.is_healthy() => println!("all is well"),
///     Some(status) => println!("faults: {}", sevenbot::register_text::faults(status.faults())),
///     None => println!("the maker's firmware does not say"),
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StatusBlock(Snapshot);

impl Arm {
    /// Reads the status block; `None` if the firmware has none, as the maker's.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn status(&mut self) -> Result<Option<StatusBlock>, Error> {
        if !self.identity().has_status_block() {
            return Ok(None);
        }
        let snapshot = self.read_span(STATUS)?;
        Ok(snapshot.has_status_block().then(|| StatusBlock::from(snapshot)))
    }
}

/// The largest increase of the counter of frames between two successive readings a few seconds apart: more than 2 s of the
/// shortest frames at 115200 baud.
const FRAMES_BETWEEN_READINGS: u32 = 4_096;

/// Has the controller restarted between two readings of its counter of frames? A restart sets the counter to 0. So the second
/// reading is smaller than the first. Because the counter wraps, this looks like a large increase. An increase of more than
/// 4,096 + `frames` counts as a restart: `frames` is the number of further frames that the arm can have accepted since the
/// first reading.
///
/// A restart remains undetected
/// - if the first reading was less than 4,096 + `frames` before the counter wraps,
/// - if the arm has accepted more frames since the restart than before it,
/// - if the readings are so far apart that 4,096 + `frames` reaches the range of the counter: 37 s at 115200 baud.
pub(crate) fn has_restarted(before: u16, after: u16, frames: u32) -> bool {
    u32::from(after.wrapping_sub(before)) > frames.saturating_add(FRAMES_BETWEEN_READINGS)
}

impl From<Snapshot> for StatusBlock {
    /// From a read that holds [`STATUS`].
    fn from(registers: Snapshot) -> Self {
        Self(registers)
    }
}

impl StatusBlock {
    /// The snapshot that holds registers 240 to 255.
    #[must_use]
    pub const fn registers(&self) -> &Snapshot {
        &self.0
    }

    /// Is there no fault, and does every servo answer?
    #[must_use]
    pub fn is_healthy(&self) -> bool {
        self.faults() == 0 && self.missing() == 0
    }

    /// The bits of [`crate::map::fault`].
    #[must_use]
    pub fn faults(&self) -> u8 {
        self.0.byte(&FAULTS)
    }

    /// The joints whose servo does not answer, as [`Joint::bit`]s.
    #[must_use]
    pub fn missing(&self) -> u8 {
        self.0.byte(&MISSING_SERVOS)
    }

    /// Does this joint's servo not answer?
    #[must_use]
    pub fn is_missing(&self, joint: Joint) -> bool {
        self.missing() & joint.bit() != 0
    }

    /// The joints whose set-point moves, as [`Joint::bit`]s.
    #[must_use]
    pub fn moving(&self) -> u8 {
        self.0.byte(&MOVING_JOINTS)
    }

    /// Does this joint's set-point move?
    #[must_use]
    pub fn is_moving(&self, joint: Joint) -> bool {
        self.moving() & joint.bit() != 0
    }

    /// The reason of the last refusal (see [`crate::map::refusal`]), and the register concerned; `None` without a refusal.
    #[must_use]
    pub fn last_refusal(&self) -> Option<(u8, u8)> {
        let reason = self.0.byte(&LAST_REFUSAL);
        (reason != refusal::NONE).then(|| (reason, self.0.byte(&LAST_REFUSED_REGISTER)))
    }

    /// Number of accepted frames; wraps.
    #[must_use]
    pub fn frames_accepted(&self) -> u16 {
        self.0.counter(&FRAMES_ACCEPTED)
    }

    /// Has the controller restarted since this earlier reading, which is a few seconds old at most?
    pub(crate) fn has_restarted_since(&self, before: &Self) -> bool {
        has_restarted(before.frames_accepted(), self.frames_accepted(), 0)
    }

    /// Number of frames with a wrong CRC; wraps.
    #[must_use]
    pub fn frames_corrupted(&self) -> u16 {
        self.0.counter(&FRAMES_CORRUPTED)
    }

    /// Number of refused frames; wraps.
    #[must_use]
    pub fn frames_refused(&self) -> u16 {
        self.0.counter(&FRAMES_REFUSED)
    }

    /// Number of questions on the servo bus without an accepted answer; wraps.
    #[must_use]
    pub fn servo_bus_errors(&self) -> u16 {
        self.0.counter(&SERVO_BUS_ERRORS)
    }

    /// Supply voltage of the servos; `None` if unknown.
    #[must_use]
    pub fn supply_volts(&self) -> Option<f64> {
        let tenths = self.0.byte(&SUPPLY_VOLTAGE);
        (tenths != 0).then(|| f64::from(tenths) / 10.0)
    }

    /// Temperature of the hottest servo in degrees Celsius; `None` if unknown.
    #[must_use]
    pub fn hottest_celsius(&self) -> Option<u8> {
        let degrees = self.0.byte(&SERVO_TEMPERATURE);
        (degrees != 0).then_some(degrees)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_of_frames_that_begins_again_tells_of_a_restart() {
        assert!(!has_restarted(7, 7, 0) && !has_restarted(65_500, 300, 0), "it wraps");
        assert!(has_restarted(200, 3, 0), "early");
        assert!(has_restarted(33_000, 12, 0) && has_restarted(60_000, 12, 0), "after half the range");
        assert!(!has_restarted(65_000, 12, 0), "undetected: the counter could have wrapped");
        assert!(
            has_restarted(0, 33_000, 0) && !has_restarted(0, 33_000, 30_000),
            "more time between the readings"
        );
    }
}
