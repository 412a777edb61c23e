//! The angles at which a joint may be: the range of its goals, which shrinks behind the joint.

use protocol_core::time::Instant;

/// The accepted distance of a joint from its range, in millidegrees, without load and speed. A goal is a multiple of a count,
/// which is up to 0.29 degrees, and the angle is measured after the goal is computed.
const TOLERANCE: i32 = 450;
/// A servo with more than this load towards the range, in 0.1 %, drives its joint back.
const DRIVES_BACK: i16 = 100;

/// Why a joint may move without a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exemption {
    /// Its servo has restarted, and has no torque until the controller gives it.
    PowerLoss,
    /// An alarm has switched its motor off. When heat ends, the servo holds its goal again by itself.
    Alarm,
    /// The motor state is not servo.
    MotorState,
    /// A hand turns the joint, or something holds it.
    Hand,
    /// The panic handler switched the servos to damping.
    Panic,
    /// Noise corrupted a command or formed one, so the command that the servo received is unknown.
    Noise,
}

/// The angles that a joint may have, in millidegrees.
#[derive(Clone, Copy, Debug)]
pub(super) struct AngleRange {
    pub(super) low: i32,
    pub(super) high: i32,
}

impl AngleRange {
    pub(super) const fn at(angle: i32) -> Self {
        Self { low: angle, high: angle }
    }

    pub(super) fn reach(&mut self, angle: i32) {
        self.low = self.low.min(angle);
        self.high = self.high.max(angle);
    }

    /// Shrinks towards the recent goals, but not past the joint.
    pub(super) fn shrink(&mut self, goals: Self, angle: i32, by: i32) {
        self.low = (self.low + by).min(angle.max(self.low)).min(goals.low);
        self.high = (self.high - by).max(angle.min(self.high)).max(goals.high);
    }

    /// True if a servo with this load, positive towards greater angles, drives a joint at this angle towards the range.
    pub(super) fn is_driven_back(&self, angle: i32, load: i16) -> bool {
        (angle > self.high && load < -DRIVES_BACK) || (angle < self.low && load > DRIVES_BACK)
    }

    pub(super) fn excess(&self, angle: i32) -> i32 {
        (angle - self.high).max(self.low - angle)
    }
}

/// The checked state of a joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointBounds {
    /// Why the joint may move without a goal, and the earliest end of the exemption.
    pub(super) exemption: Option<(Exemption, Instant)>,
    /// The last goal that its servo has received, in millidegrees. `None` from the start of an exemption other than an alarm until
    /// the next goal.
    pub(super) goal: Option<i32>,
    /// True if its servo was seen without power, and has received no goal and got no other exemption since then.
    pub(super) awaits_goal: bool,
    /// The goals of the present period of 100 ms, and of the period before.
    pub(super) goals: [AngleRange; 2],
    pub(super) range: AngleRange,
    /// Until this time the joint may run past its goals if its servo drives it back.
    pub(super) overruns_until: Instant,
    /// True if its servo had torque at the last check.
    pub(super) had_torque: bool,
    /// How far the joint was outside its range at the last check, in millidegrees. Negative inside.
    pub(super) excess: i32,
    /// The greatest yield in the present period, and in the period before, in millidegrees.
    pub(super) yields: [i32; 2],
}

impl JointBounds {
    /// The state of a joint whose servo has no power.
    pub(super) const fn without_power(now: Instant) -> Self {
        Self {
            exemption: Some((Exemption::PowerLoss, now)),
            goal: None,
            awaits_goal: false,
            goals: [AngleRange::at(0); 2],
            range: AngleRange::at(0),
            overruns_until: now,
            had_torque: false,
            excess: 0,
            yields: [0; 2],
        }
    }

    /// Exempts the joint until this time at least, because an alarm has switched its motor off. Its servo keeps its goal.
    pub(super) fn suspend(&mut self, until: Instant) {
        let why = self.exemption.map_or(Exemption::Alarm, |(why, _)| why);
        self.exemption = Some((why, until));
    }

    /// Starts a new period for the goals and for the yield.
    pub(super) fn age(&mut self) {
        let [new, _] = self.goals;
        self.goals = [AngleRange::at(self.goal.unwrap_or(0)), new];
        let [new, _] = self.yields;
        self.yields = [0, new];
    }

    /// How far the joint may be outside its range.
    pub(super) fn tolerance(&self) -> i32 {
        let [new, old] = self.yields;
        new.max(old).saturating_add(TOLERANCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lagging_joint_is_inside_its_range_and_a_falling_joint_is_not() {
        let goal = AngleRange::at(10_000);
        let mut range = AngleRange { low: 0, high: 10_000 };
        range.shrink(goal, 2_000, 3_000);
        assert_eq!((range.low, range.high), (2_000, 10_000), "not past the joint");
        range.shrink(goal, 9_900, 8_000);
        assert_eq!((range.low, range.excess(9_900)), (9_900, 0));
        range.shrink(goal, 4_000, 0);
        assert_eq!(range.excess(4_000), 5_900, "away from the goal");
        range.shrink(goal, 11_000, 0);
        assert_eq!(range.excess(11_000), 1_000);
    }

    #[test]
    fn a_servo_drives_its_joint_back_only_with_a_load_towards_the_range() {
        let range = AngleRange { low: 0, high: 10_000 };
        assert!(range.is_driven_back(12_000, -101) && range.is_driven_back(-2_000, 101));
        assert!(!range.is_driven_back(12_000, 101) && !range.is_driven_back(-2_000, -101), "away from it");
        assert!(!range.is_driven_back(12_000, -100), "as friction does");
        assert!(!range.is_driven_back(5_000, -500), "inside");
    }

    #[test]
    fn the_tolerance_is_the_greatest_yield_of_two_periods() {
        let mut bounds = JointBounds::without_power(Instant::ZERO);
        bounds.yields = [2_000, 0];
        assert_eq!(bounds.tolerance(), 2_450);
        bounds.age();
        assert_eq!(bounds.tolerance(), 2_450);
        bounds.age();
        assert_eq!(bounds.tolerance(), 450);
    }
}
