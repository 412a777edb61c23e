//! The points of the arm that can touch something, and the torques on the joints that a force at such a point causes.
//!
//! ```text
//!                       finger ──┐
//!   elbow ── wrist ── disc ──────┤ pads: the last 12 mm of each finger
//!                       finger ──┘
//! ```
//!
//! The fingers have the dimensions of the drawn model of the arm. Each finger turns by half of the angle of joint 7.

use kinematics::geometry::{CLAW_MAX, DISC_RADIUS, FINGER_AXIS, FINGER_BEND, FINGER_END};
use kinematics::{Float, Frames, Vector, forward};

use super::frame::{Point, SolidFrame, UP};
use crate::scene::Tool;

/// The radius of a finger's end, in mm.
const FINGER_RADIUS: f64 = 2.5;
/// The length of the pads, in mm.
const PAD: f64 = 12.0;
/// Distance from the disc to the end of the suction cup, in mm.
pub(super) const CUP: f64 = 25.0;
/// Half the width of the arm's parts at elbow and wrist, in mm.
const PART_RADIUS: f64 = 15.0;

/// A ball of the arm that can touch something.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) point: Point,
    pub(super) radius: f64,
    /// Number of joints that move it: 2 for the elbow, 3 for the wrist, 6 for the tool.
    pub(super) joints: usize,
    pub(super) is_finger_end: bool,
}

impl Ball {
    pub(super) const fn new(point: Point, radius: f64, joints: usize) -> Self {
        Self { point, radius, joints, is_finger_end: false }
    }
}

/// The arm in a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand {
    frames: Frames<f64>,
    claw: f64,
}

/// The space between the claws.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grip {
    /// Its origin is between the pads; x points along the tool, y from one pad to the other.
    pub(super) frame: SolidFrame,
    /// The distance between the pads, in mm.
    pub(super) gap: f64,
}

impl Hand {
    /// The arm with joints 1 to 7 at these angles in degrees.
    pub(super) fn new([t1, t2, t3, t4, t5, t6, t7]: [f64; 7]) -> Self {
        Self { frames: forward([t1, t2, t3, t4, t5, t6]), claw: t7 }
    }

    /// The axes of the tool, at its tip: x along the tool, y to one finger.
    pub(super) fn tip(&self) -> SolidFrame {
        let hand = &self.frames.hand;
        SolidFrame { origin: hand.tip, x: hand.tool, y: hand.disc, z: hand.tool.cross(hand.disc) }
    }

    pub(super) fn grip(&self) -> Grip {
        let [ahead, aside] = finger_point(FINGER_END, self.claw);
        let tip = self.tip();
        let middle = tip.point(Vector::new(ahead - PAD / 2.0, 0.0, 0.0));
        Grip { frame: SolidFrame { origin: middle, ..tip }, gap: gap(aside) }
    }

    /// All balls of an arm with this tool.
    pub(super) fn balls(&self, tool: Tool) -> impl Iterator<Item = Ball> {
        let Frames { arm, hand } = &self.frames;
        let tip = self.tip();
        let parts = [Ball::new(arm.elbow, PART_RADIUS, 2), Ball::new(arm.wrist, PART_RADIUS, 3)];
        let edge = [tip.y, -tip.y, tip.z, -tip.z];
        let edge = edge.map(|direction| Ball::new(hand.tip + direction * DISC_RADIUS, 0.0, 6));
        let ahead = |ahead, aside| Ball::new(tip.point(Vector::new(ahead, aside, 0.0)), FINGER_RADIUS, 6);
        let [[end, end_aside], [bend, bend_aside]] =
            [FINGER_END, FINGER_BEND].map(|place| finger_point(place, self.claw));
        let finger_end = |aside| Ball { is_finger_end: true, ..ahead(end, aside) };
        let tool = match tool {
            Tool::Claws => [
                finger_end(end_aside),
                finger_end(-end_aside),
                ahead(bend, bend_aside),
                ahead(bend, -bend_aside),
            ],
            Tool::Cup => [ahead(CUP - FINGER_RADIUS, 0.0); 4],
        };
        parts.into_iter().chain(edge).chain(tool)
    }

    /// The torques on joints 1 to 6 that a force in N at `point` causes, in mN m, positive towards greater angles. The first
    /// `joints` joints move the point.
    pub(super) fn torques(&self, point: Point, joints: usize, force: Point) -> [f64; 6] {
        let Frames { arm, hand } = &self.frames;
        let about = |axis: Point, centre: Point| axis.cross(point - centre).dot(force);
        let zero = Vector::new(0.0, 0.0, 0.0);
        let mut torques = [
            about(UP, zero),
            // The parallelogram moves all parts beyond the elbow without turning them.
            (-arm.left).cross(arm.elbow - arm.shoulder).dot(force),
            about(arm.left, arm.elbow),
            about(-arm.along, arm.wrist),
            about(hand.bend.cross(arm.along), arm.wrist),
            about(-hand.tool, arm.wrist),
        ];
        torques.iter_mut().skip(joints).for_each(|torque| *torque = 0.0);
        torques
    }
}

/// Converts a point of a finger to the axes of the tool with the claw at this angle: ahead of the disc, and outward, in mm.
fn finger_point([ahead, outward]: [f64; 2], claw: f64) -> [f64; 2] {
    let (sine, cosine) = Float::sin_cos(claw / 2.0);
    let [axis_ahead, axis_aside] = FINGER_AXIS;
    [axis_ahead + ahead * cosine - outward * sine, axis_aside + ahead * sine + outward * cosine]
}

/// The distance between the pads, if the ends of the fingers are this far from the tool's axis. In mm.
fn gap(aside: f64) -> f64 {
    2.0 * (aside - FINGER_RADIUS)
}

/// The angle of joint 7 in degrees at which the pads are this far apart, in mm. `None`: the width is out of reach.
pub(super) fn angle_for(width: f64) -> Option<f64> {
    let gap_at = |angle| {
        let [_, aside] = finger_point(FINGER_END, angle);
        gap(aside)
    };
    if !(gap_at(0.0)..=gap_at(CLAW_MAX)).contains(&width) {
        return None;
    }
    let (mut low, mut high) = (0.0, CLAW_MAX);
    // 20 halvings of 84 degrees leave 0.0001 degrees, far below a count of the servo.
    for _ in 0..20 {
        let middle = (low + high) / 2.0;
        if gap_at(middle) < width { low = middle } else { high = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torques_are_the_force_by_the_movement_of_the_point() {
        let pose = [70.0, 80.0, 95.0, 60.0, 120.0, 30.0, 50.0];
        let force = Vector::new(3.0, -2.0, 5.0);
        let points = |pose: [f64; 7]| {
            let frames = Hand::new(pose).frames;
            [(frames.arm.elbow, 2), (frames.arm.wrist, 3), (frames.hand.disc_edge, 6)]
        };
        for (index, (point, joints)) in points(pose).into_iter().enumerate() {
            let torques = Hand::new(pose).torques(point, joints, force);
            for (joint, torque) in torques.into_iter().enumerate() {
                let shifted = |by: f64| {
                    let mut shifted = pose;
                    shifted[joint] += by;
                    points(shifted)[index].0
                };
                let per_radian = (shifted(0.1) - shifted(-0.1)) * (1.0 / 0.2_f64.to_radians());
                let expected = per_radian.dot(force);
                assert!((torque - expected).abs() < 0.01, "{index} {joint}: {torque} {expected}");
            }
        }
    }

    #[test]
    fn claws_open_from_almost_nothing_to_75_mm() {
        let gap = |claw| Hand::new([90.0, 90.0, 65.0, 90.0, 90.0, 90.0, claw]).grip().gap;
        assert!((2.0..4.0).contains(&gap(0.0)) && (74.0..78.0).contains(&gap(84.0)));
        for width in [10.0, 30.0, 60.0] {
            let angle = angle_for(width).unwrap();
            assert!((gap(angle) - width).abs() < 0.01, "{width}: {angle}");
        }
        assert_eq!([angle_for(1.0), angle_for(90.0)], [None; 2]);
    }
}
