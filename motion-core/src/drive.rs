//! The drive of one joint: from released to engaged without a jump (D12, D13).
//!
//! ```text
//!                 wait                       measured, steady            torque is on
//!   Released ───────────────────────▶ Waiting ───────────────▶ TorquePending ─────────▶ Engaged
//!      ▲                                                          ▲     │                  │
//!      │                                          measured, steady│     │ no answers       │
//!      │                                                          │     ▼                  │
//!      └── released, from every state ──                        Silent ◀─────────────────┘
//! ```
//!
//! A waiting joint engages at its measured position. Its goal stays there until it has torque, so that the servo does
//! not jump. A silent joint keeps its set-point, because the servo may still execute what it receives. This file does
//! not know the bus or which joint it drives.

use protocol_core::time::{Duration, Instant};

use crate::calibration::MicroDegrees;
use crate::trajectory::Trajectory;

/// A silent joint that is measured within this distance of its set-point continues its move (D12).
const REJOIN_WITHIN: MicroDegrees = MicroDegrees::from_degrees(3);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Engagement {
    /// The joint is not driven.
    Released,
    /// The joint will engage at the next measurement. The trajectory keeps a target that the host writes meanwhile.
    Waiting { has_target: bool },
    /// The joint has its measured position as its goal, or its set-point if it was silent. Its torque is not on yet, unless
    /// its servo was silent only.
    TorquePending { was_silent: bool, has_new_target: bool },
    /// The joint has torque and follows its set-point.
    Engaged,
    /// The servo of a driven joint does not answer. The set-point does not move.
    Silent { has_new_target: bool },
}

/// The target of a joint that engaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The measured position: the joint holds there.
    Measured,
    /// The target that the host wrote.
    FromHost,
}

/// The drive of one joint.
#[derive(Clone, Debug)]
pub struct Drive {
    engagement: Engagement,
    trajectory: Trajectory,
}

impl Drive {
    /// A joint that is not driven.
    pub const RELEASED: Self =
        Self { engagement: Engagement::Released, trajectory: Trajectory::holding(MicroDegrees(0)) };

    /// Lets the joint engage at the next measurement.
    pub fn wait(&mut self) {
        self.engagement = Engagement::Waiting { has_target: false };
    }

    /// Stops driving the joint.
    pub fn release(&mut self) {
        *self = Self::RELEASED;
    }

    /// Marks the servo as silent. An engaged joint keeps its set-point until the servo answers again. A joint whose
    /// torque is pending waits again, or is silent again.
    pub fn mark_silent(&mut self) {
        self.engagement = match self.engagement {
            Engagement::Engaged => Engagement::Silent { has_new_target: false },
            Engagement::TorquePending { was_silent: true, has_new_target } => {
                Engagement::Silent { has_new_target }
            }
            Engagement::TorquePending { .. } => {
                Engagement::Waiting { has_target: self.trajectory.is_moving() }
            }
            other => other,
        };
    }

    /// Sets the target that the host wrote. A released joint ignores it.
    pub fn set_target(&mut self, angle: MicroDegrees, time: u8) {
        if let Some(trajectory) = self.take_target() {
            trajectory.move_to(angle, time);
        }
    }

    /// Adds the next point of a stream, whose frame came at `now`. A released joint ignores it.
    pub fn stream_to(&mut self, angle: MicroDegrees, now: Instant, period: Duration) {
        if let Some(trajectory) = self.take_target() {
            trajectory.stream_to(angle, now, period);
        }
    }

    /// The trajectory for a new target of the host; `None` for a released joint.
    fn take_target(&mut self) -> Option<&mut Trajectory> {
        match &mut self.engagement {
            Engagement::Released => return None,
            Engagement::Waiting { has_target: is_new }
            | Engagement::Silent { has_new_target: is_new }
            | Engagement::TorquePending { has_new_target: is_new, .. } => *is_new = true,
            Engagement::Engaged => {}
        }
        Some(&mut self.trajectory)
    }

    /// Lets the joint hold at its set-point, and forgets a target that the host wrote before.
    pub fn hold(&mut self) {
        if let Engagement::Waiting { has_target: is_new }
        | Engagement::Silent { has_new_target: is_new }
        | Engagement::TorquePending { has_new_target: is_new, .. } = &mut self.engagement
        {
            *is_new = false;
        }
        self.trajectory = Trajectory::holding(self.set_point());
    }

    /// Engages a joint that is at rest at `angle`. A waiting joint engages there. A silent joint continues from its
    /// set-point if that is near, and engages at `angle` otherwise. Returns the target if the joint engaged.
    pub fn engage(&mut self, angle: MicroDegrees) -> Option<Target> {
        let (Engagement::Waiting { has_target } | Engagement::Silent { has_new_target: has_target }) =
            self.engagement
        else {
            return None;
        };
        let was_silent = self.is_silent();
        let continues = was_silent && is_near(self.set_point(), angle);
        let target = if continues || has_target { Target::FromHost } else { Target::Measured };
        if target == Target::Measured {
            self.trajectory = Trajectory::holding(angle);
        } else if !continues {
            self.trajectory.rebase(angle);
        }
        self.engagement = Engagement::TorquePending { was_silent, has_new_target: has_target };
        Some(target)
    }

    /// The servo has no torque any more: the joint engages anew where it is measured. Unless `keeps_target`, a target of the
    /// host that came before is forgotten.
    pub fn lose_torque(&mut self, keeps_target: bool) {
        self.engagement = match self.engagement {
            Engagement::Engaged | Engagement::TorquePending { .. } => {
                Engagement::Waiting { has_target: keeps_target && self.trajectory.is_moving() }
            }
            Engagement::Silent { has_new_target } => Engagement::Waiting { has_target: has_new_target },
            other => other,
        };
    }

    /// Is the joint engaged?
    #[must_use]
    pub fn is_engaged(&self) -> bool {
        self.engagement == Engagement::Engaged
    }

    /// Does the joint wait to be measured?
    pub(crate) fn is_waiting(&self) -> bool {
        matches!(self.engagement, Engagement::Waiting { .. })
    }

    /// Has the servo of a driven joint fallen silent?
    #[must_use]
    pub fn is_silent(&self) -> bool {
        matches!(self.engagement, Engagement::Silent { .. })
    }

    /// Records that the joint has torque. From now on its set-point may move.
    pub fn torque_is_on(&mut self) {
        if self.is_torque_pending() {
            self.engagement = Engagement::Engaged;
        }
    }

    /// Replaces the set-point after a change of the joint's offset. `set_point` and `target` use the new offset.
    pub fn rebase_offset(&mut self, set_point: MicroDegrees, target: MicroDegrees, time: u8) {
        if self.has_set_point() {
            self.trajectory = Trajectory::holding(set_point);
            self.trajectory.move_to(target, time);
        }
    }

    /// Advances the set-point by the control cycle that ends at `end`, at `speed` (the joint's speed register).
    pub fn advance(&mut self, end: Instant, speed: u8) {
        if self.engagement == Engagement::Engaged {
            self.trajectory.advance(end, speed);
        }
    }

    /// See [`Trajectory::hold_back`].
    pub fn hold_back(&mut self, set_point: MicroDegrees) {
        self.trajectory.hold_back(set_point);
    }

    /// Does the joint have a set-point? A silent joint does, because its servo may still hold there.
    #[must_use]
    pub fn has_set_point(&self) -> bool {
        self.is_driven() || self.is_silent()
    }

    /// Is the joint engaged, or is its torque pending? Only such a joint is sent goals.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        matches!(self.engagement, Engagement::TorquePending { .. } | Engagement::Engaged)
    }

    /// Is the joint waiting for its torque?
    #[must_use]
    pub fn is_torque_pending(&self) -> bool {
        matches!(self.engagement, Engagement::TorquePending { .. })
    }

    /// Has the set-point not reached the target, or is a target waiting?
    #[must_use]
    pub fn is_moving(&self) -> bool {
        match self.engagement {
            Engagement::Released => false,
            Engagement::Waiting { has_target } => has_target,
            Engagement::TorquePending { .. } | Engagement::Engaged | Engagement::Silent { .. } => {
                self.trajectory.is_moving()
            }
        }
    }

    /// The target of the trajectory; in a stream its newest point.
    #[must_use]
    pub const fn target(&self) -> MicroDegrees {
        self.trajectory.target()
    }

    /// The present set-point of a joint that has one.
    #[must_use]
    pub const fn set_point(&self) -> MicroDegrees {
        self.trajectory.set_point()
    }
}

/// Is a joint measured at `angle` so near to its set-point that it goes on from there (D12)?
pub(crate) fn is_near(set_point: MicroDegrees, angle: MicroDegrees) -> bool {
    angle.0.abs_diff(set_point.0) <= REJOIN_WITHIN.0.unsigned_abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(degrees: u8) -> MicroDegrees {
        MicroDegrees::from_degrees(degrees)
    }

    /// A joint that has torque and holds at 40 degrees.
    fn engaged() -> Drive {
        let mut drive = Drive::RELEASED;
        drive.wait();
        drive.engage(degrees(40));
        drive.torque_is_on();
        drive
    }

    /// A joint that fell silent at 41.9 degrees during a move to 80 degrees.
    fn silent() -> Drive {
        let mut drive = engaged();
        drive.set_target(degrees(80), 0);
        drive.advance(Instant::ZERO, 100);
        drive.mark_silent();
        drive
    }

    #[test]
    fn d12_a_joint_engages_where_it_is_and_holds() {
        let mut drive = Drive::RELEASED;
        assert_eq!(drive.engage(degrees(40)), None, "the joint is released");
        drive.wait();
        assert!(!drive.is_driven());
        assert_eq!(drive.engage(degrees(40)), Some(Target::Measured));
        drive.advance(Instant::ZERO, 100);
        assert!(drive.is_driven() && !drive.is_moving());
        assert_eq!(drive.set_point(), degrees(40));
        assert_eq!(drive.engage(degrees(50)), None, "only once");
    }

    #[test]
    fn a_target_written_while_waiting_is_approached_at_the_set_speed() {
        let mut drive = Drive::RELEASED;
        drive.set_target(degrees(10), 0);
        drive.wait();
        assert!(!drive.is_moving());
        drive.set_target(degrees(60), 0);
        assert!(drive.is_moving(), "the move is not over");
        assert_eq!(drive.engage(degrees(40)), Some(Target::FromHost));
        drive.advance(Instant::ZERO, 100);
        assert_eq!(drive.set_point(), degrees(40), "the set-point waits for torque");
        drive.torque_is_on();
        drive.advance(Instant::ZERO, 100);
        assert_eq!(drive.set_point(), MicroDegrees(41_900_000), "from the measured position");
    }

    #[test]
    fn d12_a_silent_joint_stops_its_set_point_and_is_driven_on_from_there() {
        for found in [38_900_000, 41_900_000, 44_900_000].map(MicroDegrees) {
            let mut drive = silent();
            drive.advance(Instant::ZERO, 100);
            assert!(!drive.is_driven(), "no goal is sent to it");
            assert_eq!(drive.set_point(), MicroDegrees(41_900_000));
            assert_eq!(drive.engage(found), Some(Target::FromHost));
            drive.torque_is_on();
            drive.advance(Instant::ZERO, 100);
            assert_eq!(drive.set_point(), MicroDegrees(43_800_000), "found at {found:?}");
        }
    }

    #[test]
    fn d12_a_silent_joint_that_is_found_elsewhere_holds_there() {
        for found in [38_899_999, 44_900_001, 170_000_000].map(MicroDegrees) {
            let mut drive = silent();
            assert_eq!(drive.engage(found), Some(Target::Measured));
            assert!(drive.is_driven() && !drive.is_moving(), "the old move is forgotten");
            assert_eq!(drive.set_point(), found);
        }
    }

    #[test]
    fn d12_a_silent_joint_keeps_a_target_that_the_host_writes() {
        let mut elsewhere = silent();
        elsewhere.set_target(degrees(30), 0);
        assert_eq!(elsewhere.engage(degrees(60)), Some(Target::FromHost));
        elsewhere.torque_is_on();
        elsewhere.advance(Instant::ZERO, 100);
        assert_eq!(elsewhere.set_point(), MicroDegrees(58_100_000), "from the measured position");
        let mut near = silent();
        near.set_target(degrees(30), 0);
        near.engage(degrees(42));
        near.torque_is_on();
        near.advance(Instant::ZERO, 100);
        assert_eq!(near.set_point(), degrees(40), "from its set-point");
    }

    #[test]
    fn d12_a_joint_that_falls_silent_before_it_has_torque_engages_where_it_is_found() {
        let mut drive = Drive::RELEASED;
        drive.wait();
        drive.engage(degrees(40));
        drive.mark_silent();
        assert_eq!(drive.engage(degrees(41)), Some(Target::Measured));
        assert_eq!(drive.set_point(), degrees(41));
        drive.set_target(degrees(60), 0);
        drive.mark_silent();
        assert_eq!(drive.engage(degrees(42)), Some(Target::FromHost), "the target is kept");
        assert_eq!(drive.set_point(), degrees(42));
    }

    #[test]
    fn d12_a_joint_that_falls_silent_again_before_its_torque_was_read_is_driven_on() {
        let mut drive = silent();
        drive.engage(degrees(43));
        drive.mark_silent();
        assert!(drive.is_silent());
        assert_eq!(drive.engage(degrees(43)), Some(Target::FromHost));
        drive.torque_is_on();
        drive.advance(Instant::ZERO, 100);
        assert_eq!(drive.set_point(), MicroDegrees(43_800_000), "from its set-point");
    }

    #[test]
    fn silence_changes_nothing_for_a_joint_that_is_not_driven() {
        let mut drive = Drive::RELEASED;
        drive.mark_silent();
        assert_eq!(drive.engage(degrees(1)), None, "a released joint stays released");
        drive.wait();
        drive.set_target(degrees(60), 0);
        drive.mark_silent();
        assert_eq!(drive.engage(degrees(40)), Some(Target::FromHost), "the target is kept");
    }

    #[test]
    fn a_new_offset_rebases_the_set_point_of_a_driven_and_of_a_silent_joint() {
        let mut released = Drive::RELEASED;
        released.rebase_offset(degrees(1), degrees(1), 0);
        assert_eq!(released.set_point(), MicroDegrees(0));
        for mut drive in [engaged(), silent()] {
            drive.rebase_offset(degrees(43), degrees(40), 0);
            assert_eq!(drive.set_point(), degrees(43));
            assert!(drive.is_moving());
        }
    }
}
