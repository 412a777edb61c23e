//! One joint: its drive, its target, and what its servo measured (D12, D21).
//!
//! This file does not know the other joints.

use protocol_core::registers::map::{
    FINE_POSITION, FINE_TARGET, LOAD, PRESENT_POSITION, TARGET_POSITION, VELOCITY,
};
use protocol_core::registers::map21::{PRESENT_ANGLE, PRESENT_LOAD};
use protocol_core::registers::{Joint, RegisterFile};
use protocol_core::time::Instant;

use crate::calibration::{MicroDegrees, angle_from_counts, load_from_servo, velocity_from_servo};
use crate::drive::{Drive, Target};
use crate::position_filter::{FilterOutcome, PositionFilter};
use crate::servo_bus::Reading;

/// The effect of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measured {
    /// The position filter rejected the reading.
    Rejected,
    /// The filter rejected the reading, and the servo counts as silent from now on.
    FellSilent,
    /// The filter accepted the reading. The servo was not silent, and its error bits and its temperature are as before.
    Accepted,
    /// The filter accepted the reading. The servo was silent, or its error bits or its temperature changed.
    ServoChanged,
    /// The filter accepted the reading, and the joint engaged: it needs its goal, then torque.
    Engaged,
}

/// The state of one joint.
#[derive(Clone, Debug)]
pub(crate) struct JointState {
    joint: Joint,
    pub(crate) drive: Drive,
    pub(crate) position: PositionFilter,
    /// The target. Registers show it in degrees and in hundredths of a degree.
    target: MicroDegrees,
    /// Where the joint was last measured; `None` until then.
    measured: Option<MicroDegrees>,
    /// As the servo measured it, in counts per second.
    servo_velocity: i16,
    /// In 0.1 % of the stall torque, positive towards greater angles.
    load: i16,
    /// The error bits of the servo's last answer.
    pub(crate) alarms: u8,
    /// In degrees Celsius; 0 while unknown.
    pub(crate) temperature: u8,
}

impl JointState {
    /// A joint at power-up.
    pub(crate) const fn new(joint: Joint, drive: Drive) -> Self {
        Self {
            joint,
            drive,
            position: PositionFilter::UNKNOWN,
            target: MicroDegrees::from_degrees(TARGET_POSITION.default_at(TARGET_POSITION.of(joint))),
            measured: None,
            servo_velocity: 0,
            load: 0,
            alarms: 0,
            temperature: 0,
        }
    }

    /// The target.
    pub(crate) const fn target(&self) -> MicroDegrees {
        self.target
    }

    /// Where the joint stands, if its servo answers.
    pub(crate) fn known_angle(&self) -> Option<MicroDegrees> {
        self.measured.filter(|_| self.position.is_known())
    }

    /// Was the joint measured since power-up?
    pub(crate) const fn was_measured(&self) -> bool {
        self.measured.is_some()
    }

    /// Processes a reading. If `may_engage`, a waiting joint at rest engages.
    pub(crate) fn read(
        &mut self,
        now: Instant,
        (reading, alarms): (Reading, u8),
        may_engage: bool,
        registers: &mut RegisterFile,
    ) -> Measured {
        let was_known = self.position.is_known();
        let counts = match self.position.answered(now, reading.position_counts) {
            FilterOutcome::Accepted(counts) => counts,
            FilterOutcome::Rejected => return Measured::Rejected,
            FilterOutcome::FellSilent => {
                self.fall_silent();
                return Measured::FellSilent;
            }
        };
        let angle = angle_from_counts(self.joint, counts, registers.offset(self.joint));
        self.measured = Some(angle);
        self.servo_velocity = reading.speed;
        self.load = load_from_servo(self.joint, reading.load);
        let servo = (alarms, reading.temperature_celsius);
        let is_unchanged = was_known && servo == (self.alarms, self.temperature);
        (self.alarms, self.temperature) = servo;
        registers.set(PRESENT_POSITION.of(self.joint), angle.nearest_degree());
        registers.set(PRESENT_ANGLE.of(self.joint), angle.nearest_degree());
        registers.set(PRESENT_LOAD.of(self.joint), shown_load(self.load));
        let may_engage = may_engage && self.position.is_steady();
        let Some(target) = (if may_engage { self.drive.engage(angle) } else { None }) else {
            return if is_unchanged { Measured::Accepted } else { Measured::ServoChanged };
        };
        if target == Target::Measured {
            self.set_target(angle, registers);
        }
        Measured::Engaged
    }

    pub(crate) fn fall_silent(&mut self) {
        self.drive.mark_silent();
        self.temperature = 0;
        self.alarms = 0;
    }

    /// Moves to a target that the register shows already.
    pub(crate) fn move_to(&mut self, degrees: u8, time: u8) {
        self.target = MicroDegrees::from_degrees(degrees);
        self.drive.set_target(self.target, time);
    }

    /// Sets the target, without a move.
    pub(crate) fn set_target(&mut self, target: MicroDegrees, registers: &mut RegisterFile) {
        self.target = target;
        registers.set(TARGET_POSITION.of(self.joint), target.nearest_degree());
    }

    /// Holds at the set-point, which becomes the target. A joint without a set-point keeps its target.
    pub(crate) fn hold(&mut self, registers: &mut RegisterFile) {
        self.drive.hold();
        if self.drive.has_set_point() {
            self.set_target(self.drive.set_point(), registers);
        }
    }

    /// Shows target, position, velocity and load in the extended block (D21).
    pub(crate) fn show_extended(&self, registers: &mut RegisterFile) {
        let position = self.measured.map_or(u16::MAX, MicroDegrees::nearest_centidegree);
        let velocity = velocity_from_servo(self.joint, self.servo_velocity);
        for (row, word) in [
            (FINE_TARGET, self.target.nearest_centidegree()),
            (FINE_POSITION, position),
            (VELOCITY, velocity.cast_unsigned()),
            (LOAD, self.load.cast_unsigned()),
        ] {
            registers.set_word(row.of(self.joint), word);
        }
    }
}

/// The register value of a load in 0.1 %: 128 + load / 8, 3 to 253 (M9).
fn shown_load(load: i16) -> u8 {
    let steps = (load / 8).clamp(-125, 125);
    u8::try_from(128 + steps).unwrap_or(128)
}
