//! The angles of the joints from the positions of their servos, finer than a count, and the directions of the arm's parts.

use motion_core::calibration::angle_from_counts;
use protocol_core::registers::{JOINTS, Joint};

use super::sine::{cosine, sine};
use crate::servo::units::COUNT;

/// For both kinds of servo, this many counts are a whole number of thousandths of a degree.
const SPAN: u16 = 850;

/// Converts positions of a joint's servo to angles of the joint, and back.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct AngleScale {
    /// The angle at 0 counts, in thousandths of a degree.
    first: i64,
    /// The angle of [`SPAN`] counts. It is negative if more counts mean a smaller angle.
    span: i64,
}

impl AngleScale {
    pub(crate) fn of(joint: Joint) -> Self {
        let angle = |counts| i64::from(angle_from_counts(joint, counts, 0).0) / 1_000;
        Self { first: angle(0), span: angle(SPAN) - angle(0) }
    }

    /// The angle in thousandths of a degree, at a servo position in millionths of a count.
    pub(crate) fn angle(self, position: i64) -> i64 {
        let span = i64::from(SPAN) * COUNT;
        self.first + (self.span * position + span / 2).div_euclid(span)
    }

    /// The servo position in millionths of a count, at an angle in thousandths of a degree.
    pub(crate) fn position(self, angle: i64) -> i64 {
        self.distance(angle - self.first)
    }

    /// Converts a distance of the joint in thousandths of a degree to a distance of its servo in millionths of a count.
    pub(crate) fn distance(self, angle: i64) -> i64 {
        (angle * i64::from(SPAN) * COUNT).checked_div(self.span).unwrap_or(0)
    }

    /// Converts a stiffness from millinewton metres per degree to micronewton metres per count.
    pub(crate) fn torque_per_count(self, torque_per_degree: i64) -> i64 {
        torque_per_degree * self.span.abs() / i64::from(SPAN)
    }

    /// Converts a torque that is positive towards greater angles to one that is positive towards more counts. The conversion is
    /// its own inverse.
    pub(crate) const fn torque_towards_counts(self, torque: i64) -> i64 {
        if self.span < 0 { -torque } else { torque }
    }
}

/// The sine and the cosine of an angle, in millionths.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SineAndCosine {
    /// The angle in thousandths of a degree.
    millidegrees: i64,
    pub(crate) sin: i64,
    pub(crate) cos: i64,
}

impl SineAndCosine {
    const fn of(millidegrees: i64) -> Self {
        Self { millidegrees, sin: sine(millidegrees), cos: cosine(millidegrees) }
    }

    /// Sets the angle. Returns whether it has changed.
    fn turn_to(&mut self, millidegrees: i64) -> bool {
        let has_turned = millidegrees != self.millidegrees;
        if has_turned {
            *self = Self::of(millidegrees);
        }
        has_turned
    }
}

/// The sines and cosines of the angles that determine the directions of the parts with weight.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct JointSines {
    /// The angle of the rear arm above the horizontal.
    pub(crate) rear: SineAndCosine,
    /// The angle of the forearm below the horizontal.
    pub(crate) drop: SineAndCosine,
    /// The angle of joint 4, the roll of the tool.
    pub(crate) roll: SineAndCosine,
    /// The angle of joint 5, the pitch of the tool.
    pub(crate) pitch: SineAndCosine,
}

/// The angle of joint 3 at which the forearm is level, in thousandths of a degree.
const LEVEL: i64 = 65_000;

impl JointSines {
    /// From the angles of the joints in thousandths of a degree.
    pub(crate) const fn of([_, rear, forearm, roll, pitch, _, _]: [i64; JOINTS]) -> Self {
        Self {
            rear: SineAndCosine::of(rear),
            drop: SineAndCosine::of(forearm - LEVEL),
            roll: SineAndCosine::of(roll),
            pitch: SineAndCosine::of(pitch),
        }
    }

    /// Turns the joints to these angles. Returns whether the direction of any part has changed.
    pub(crate) fn turn_to(&mut self, [_, rear, forearm, roll, pitch, _, _]: [i64; JOINTS]) -> bool {
        let turned = [
            self.rear.turn_to(rear),
            self.drop.turn_to(forearm - LEVEL),
            self.roll.turn_to(roll),
            self.pitch.turn_to(pitch),
        ];
        turned.contains(&true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_counts_have_the_angles_of_the_calibration() {
        for joint in Joint::ALL {
            for counts in 0..=1_023 {
                let wanted = angle_from_counts(joint, counts, 0).0 / 1_000;
                let is = AngleScale::of(joint).angle(i64::from(counts) * COUNT);
                assert!((is - i64::from(wanted)).abs() <= 1, "{joint:?} at {counts}: {is}, not {wanted}");
            }
        }
    }

    #[test]
    fn a_position_is_that_of_its_angle() {
        for joint in Joint::ALL {
            for degrees in (0..=180).step_by(10) {
                let wanted = degrees * 1_000;
                let scale = AngleScale::of(joint);
                assert!((scale.angle(scale.position(wanted)) - wanted).abs() <= 1, "{joint:?} {degrees}");
            }
        }
        // 180 degrees are 850 counts of joint 1 and 625 counts of joint 7.
        assert_eq!(
            [0, 6].map(|index| AngleScale::of(Joint::ALL[index]).torque_per_count(850)),
            [180_000, 244_800]
        );
    }

    #[test]
    fn a_tenth_of_a_count_changes_the_angle() {
        let scale = AngleScale::of(Joint::ALL[0]);
        assert_eq!(scale.angle(511 * COUNT + COUNT / 10) - scale.angle(511 * COUNT), 21);
        let towards_counts = Joint::ALL.map(|joint| AngleScale::of(joint).torque_towards_counts(1));
        assert_eq!(towards_counts, [1, -1, -1, -1, -1, -1, 1]);
    }
}
