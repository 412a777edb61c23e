//! The status block, registers 240 to 255 (docs/protocol.md, section 6).

use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    FAULTS, FRAMES_ACCEPTED, FRAMES_CORRUPTED, FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER,
    MISSING_SERVOS, MOVING_JOINTS, SERVO_BUS_ERRORS, SERVO_TEMPERATURE, STATUS_VERSION, SUPPLY_VOLTAGE,
    refusal,
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
        let is_there = snapshot.byte(&STATUS_VERSION) != 0;
        Ok(is_there.then(|| StatusBlock::from(snapshot)))
    }
}

/// A counter of frames that seems to have gone back by less than half its range was reset.
const HALF_COUNTER: u16 = u16::MAX / 2;

/// Has the controller restarted between two readings of its counter of frames? A restart sets it to 0.
pub(crate) const fn has_restarted(before: u16, after: u16) -> bool {
    let went_back = before.wrapping_sub(after);
    went_back != 0 && went_back <= HALF_COUNTER
}

impl From<Snapshot> for StatusBlock {
    /// From a read that holds [`STATUS`].
    fn from(registers: Snapshot) -> Self {
        Self(registers)
    }
}

impl StatusBlock {
    /// The registers.
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

    /// The reason of the last refusal (see [`crate::map::refusal`]), and the register concerned.
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
