//! The true state of the servos, and what the controller can know of it.

use arm_sim::servo::ServoFault;
use motion_core::servo_bus::Torque;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::{Availability, DisturbanceRates, DisturbedBus, MAX_DELAY};
use crate::world::joint_truth::JointTruth;
use crate::world::status_reply::StatusFields;

/// The controller repeats a lost torque frame within this time.
const REPEAT_TIME: Duration = Duration::from_millis(600);
/// The controller knows the state of a servo that has responded for this long.
const SETTLED: Duration = Duration::from_millis(3_000);

impl DisturbedBus {
    pub(crate) fn position(&self, joint: Joint) -> u16 {
        self.plant.position_counts(joint)
    }

    /// The true angle of a joint in millidegrees.
    pub(crate) fn angle(&self, joint: Joint) -> i32 {
        self.plant.angle(joint)
    }

    /// The goal that the servo of a joint truly holds, in counts.
    pub(crate) fn servo_goal(&self, joint: Joint) -> u16 {
        self.plant.goal_counts(joint)
    }

    pub(crate) fn last_status(&self, joint: Joint) -> StatusFields {
        self.last_status[joint]
    }

    /// The history of the torque, alarms and pushes of a joint.
    pub(crate) fn truth(&self, joint: Joint) -> &JointTruth {
        &self.truths[joint]
    }

    /// True if the servo has power and its torque switch is not on.
    pub(crate) fn is_free(&self, joint: Joint) -> bool {
        matches!(self.plant.torque(joint), Some(torque) if torque != Torque::On)
    }

    /// True if the servo drives its motor.
    pub(crate) fn has_torque(&self, joint: Joint) -> bool {
        self.plant.torque(joint) == Some(Torque::On)
    }

    /// True if all servos have responded for [`SETTLED`] and hold torque, and the controller cannot take one for let go.
    pub(crate) fn all_hold(&self, now: Instant) -> bool {
        let responds = |joint: Joint| matches!(self.availability(joint), Availability::Responding(since) if now - since > SETTLED);
        let holds =
            |joint: &Joint| responds(*joint) && self.has_torque(*joint) && !self.may_be_let_go(*joint, now);
        Joint::ALL.iter().all(holds)
    }

    /// True if the controller may take the joint for let go (D28), perhaps because of a false reading.
    pub(crate) fn may_be_let_go(&self, joint: Joint, now: Instant) -> bool {
        self.truths[joint].may_be_let_go(now) || self.may_be_misread(joint, now)
    }

    /// True if there have been no disturbances for long enough that the controller knows the state of the servos.
    pub(crate) fn is_undisturbed(&self, now: Instant) -> bool {
        self.disturbance == DisturbanceRates::default() && now - self.disturbed_at > REPEAT_TIME
    }

    /// True if the controller may use a false reading of this joint.
    pub(crate) fn may_be_misread(&self, joint: Joint, now: Instant) -> bool {
        self.misreadings.may_be_used(joint, now)
    }

    /// The accepted error of a position reading, in counts: above 0 for some time after an undetected error.
    pub(crate) fn position_tolerance(&self, joint: Joint, now: Instant) -> u64 {
        self.misreadings.tolerance(joint, now)
    }

    /// The largest age of a reading when its reply arrives.
    pub(crate) fn reply_age(&self, joint: Joint) -> Duration {
        let delayed = if self.disturbance.delayed > 0 { MAX_DELAY } else { Duration::ZERO };
        match self.faults[joint] {
            Some(ServoFault::Late(by)) => by.max(delayed),
            _ => delayed,
        }
    }

    pub(crate) fn availability(&self, joint: Joint) -> Availability {
        let since = self.since[joint];
        // A corrupted reply with a valid checksum ends a silence.
        let silent = Availability::Silent(since.max(self.misreadings.may_be_used_until(joint)));
        match self.faults[joint] {
            _ if self.is_stopped => silent,
            Some(ServoFault::Missing | ServoFault::Garbled(1)) => silent,
            // After a restart, the controller may take each late reply for the reply to its next read.
            Some(ServoFault::Late(_)) if self.restarted_at > since => Availability::Uncertain,
            Some(ServoFault::Late(by)) if by >= self.late_limit => silent,
            Some(ServoFault::Late(by)) if by > self.timely_limit => Availability::Uncertain,
            Some(ServoFault::Garbled(_)) => Availability::Uncertain,
            _ => Availability::Responding(since.max(self.disturbed_at).max(self.outran_at[joint])),
        }
    }
}
