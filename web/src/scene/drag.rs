//! Dragging: finds the angle of a joint that follows the pointer, and the pose for a dragged tip by inverse kinematics.

use arm_model::Body;
use glam::{Vec2, Vec3};
use kinematics::geometry::{CLAW_MAX, JOINT_MAX, LEVEL_FOREARM, LINKAGE_MAX, LINKAGE_MIN};
use kinematics::nearest::nearest_tip;
use kinematics::{NoSolution, forward, ik6, ik6_all};
use sevenbot::cartesian::{Breach, Guard};

use super::arm::{Angles, Hit, from_vector, point_of, tip_of, to_vector};
use super::camera::Camera;

/// Each movement of the pointer searches the angles up to this far on both sides of the last angle, in degrees.
const SEARCH: f32 = 24.0;
/// The cost of a turn, in square pixels per square degree. It keeps the angle if a turn hardly moves the point on the screen.
const COST_OF_TURNING: f32 = 0.02;

/// A drag of a joint by a point of its part. The joint takes the angle that brings the point nearest to the pointer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointDrag {
    joint: u8,
    body: Body,
    local: Vec3,
    /// The vector from the projected point to the pointer at the start, in CSS pixels.
    offset: Vec2,
    /// The last angle, in degrees.
    angle: f32,
}

impl JointDrag {
    /// Begins a drag at a hit. `None` for the base, or if [`Camera::project`] gives no pixel for the point.
    #[must_use]
    pub fn start(hit: Hit, angles: Angles, camera: &Camera, pointer: Vec2) -> Option<Self> {
        let joint = hit.body.joint()?;
        let angle = *angles.get(usize::from(joint).checked_sub(1)?)?;
        let drawn = camera.project(point_of(angles, hit.body, hit.local))?;
        Some(Self { joint, body: hit.body, local: hit.local, offset: pointer - drawn, angle })
    }

    /// The number of the joint, 1 to 7.
    #[must_use]
    pub const fn joint(&self) -> u8 {
        self.joint
    }

    /// Moves the pointer. Returns the new angle of the joint in degrees, with the other joints at `angles`, within the limits of
    /// the joint, the linkage and the claw.
    pub fn to(&mut self, pointer: Vec2, angles: Angles, camera: &Camera) -> f32 {
        let [low, high] = limits(self.joint, angles);
        let wanted = pointer - self.offset;
        let last = self.angle.clamp(low, high);
        let cost = |angle: f32| {
            let point = point_of(with_joint(angles, self.joint, angle), self.body, self.local);
            let missed = camera.project(point).map_or(f32::MAX, |drawn| drawn.distance_squared(wanted));
            missed + COST_OF_TURNING * (angle - last).powi(2)
        };
        let mut best = last;
        let mut step = 2.0;
        let mut reach = SEARCH;
        while step > 0.01 {
            let candidates = steps(best, reach, step).map(|angle| angle.clamp(low, high));
            best = candidates.min_by(|one, other| cost(*one).total_cmp(&cost(*other))).unwrap_or(best);
            (reach, step) = (step, step / 8.0);
        }
        self.angle = best;
        best
    }
}

/// Angles on both sides of `middle` up to `reach`, the nearest first.
fn steps(middle: f32, reach: f32, step: f32) -> impl Iterator<Item = f32> {
    let outward = std::iter::successors(Some(0.0), move |offset| Some(offset + step));
    outward
        .take_while(move |offset| *offset <= reach)
        .flat_map(move |offset| [middle + offset, middle - offset])
}

/// The lowest and the highest angle of a joint while the other joints are at these angles, in degrees.
#[expect(clippy::cast_possible_truncation, reason = "limits in whole degrees")]
#[must_use]
pub fn limits(joint: u8, angles: Angles) -> [f32; 2] {
    let [_, t2, t3, ..] = angles;
    let top = JOINT_MAX as f32;
    let linked = |other: f32| {
        let [low, high] = [LINKAGE_MIN, LINKAGE_MAX].map(|limit| (limit + LEVEL_FOREARM) as f32 - other);
        let low = low.clamp(0.0, top);
        [low, high.clamp(low, top)]
    };
    match joint {
        2 => linked(t3),
        3 => linked(t2),
        7 => [0.0, CLAW_MAX as f32],
        _ => [0.0, top],
    }
}

/// Replaces the angle of one joint, 1 to 7, in degrees.
#[must_use]
pub fn with_joint(mut angles: Angles, joint: u8, degrees: f32) -> Angles {
    if let Some(angle) = usize::from(joint).checked_sub(1).and_then(|place| angles.get_mut(place)) {
        *angle = degrees;
    }
    angles
}

/// A wanted position of the tip, and the pose for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipWish {
    /// The wanted position of the tip, in mm.
    pub tip: Vec3,
    /// The angles that reach the position, or the reason why the arm cannot go there.
    pub reach: Result<Angles, RefusedWish>,
}

/// The reason why the tip cannot be at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WishRefusal {
    /// No angles reach the position with the direction of the tool.
    OutOfReach(NoSolution),
    /// The guard of the workspace does not allow the pose.
    Guarded(Breach),
}

/// The failure for a position that is out of reach or not allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefusedWish {
    /// Out of reach, or refused by the guard.
    pub why: WishRefusal,
    /// For a position out of reach, the angles of the nearest pose with the same direction of the tool. `None` if there is none,
    /// if the guard does not allow the pose, or if the guard refused the position.
    pub nearest: Option<Angles>,
}

/// Solves the inverse kinematics for a position of the tip in mm, with the same direction of the tool as at `angles`. Joints 6
/// and 7 keep their angles. The guard of the workspace has to allow the pose: no part of the arm below the table or in the base.
#[must_use]
pub fn wish(tip: Vec3, angles: Angles) -> TipWish {
    let [t1, t2, t3, t4, t5, t6, _] = angles.map(f64::from);
    let tool = forward([t1, t2, t3, t4, t5, t6]).hand.tool;
    let asked = to_vector(tip);
    let reach =
        ik6(asked, tool).map(|solution| nearest_solution(tip, angles).unwrap_or(extended(solution, angles)));
    let reach = reach.map_err(|why| {
        let nearest = nearest_tip(asked, tool).and_then(|point| nearest_solution(from_vector(point), angles));
        let nearest = nearest.filter(|&nearest| allowed(nearest).is_ok());
        RefusedWish { why: WishRefusal::OutOfReach(why), nearest }
    });
    TipWish { tip, reach: reach.and_then(|reached| allowed(reached).map(|()| reached)) }
}

/// Checks these angles with the guard of the workspace.
fn allowed(angles: Angles) -> Result<(), RefusedWish> {
    let [t1, t2, t3, t4, t5, ..] = angles.map(f64::from);
    let refused = |breach| RefusedWish { why: WishRefusal::Guarded(breach), nearest: None };
    Guard::default().check_pose([t1, t2, t3, t4, t5]).map_err(refused)
}

/// The solution for a position of the tip that is nearest to `angles`: the largest turn of a joint is smallest. `None` if there
/// is no solution.
fn nearest_solution(tip: Vec3, angles: Angles) -> Option<Angles> {
    let [t1, t2, t3, t4, t5, t6, _] = angles.map(f64::from);
    let tool = forward([t1, t2, t3, t4, t5, t6]).hand.tool;
    let solutions = ik6_all(to_vector(tip), tool).ok()?;
    let all = solutions.into_iter().flatten().map(|solution| extended(solution, angles));
    all.min_by(|one, other| largest_turn(*one, angles).total_cmp(&largest_turn(*other, angles)))
}

fn largest_turn(one: Angles, other: Angles) -> f32 {
    one.iter().zip(other).map(|(one, other)| (one - other).abs()).fold(0.0, f32::max)
}

/// Adds joints 6 and 7 from `angles` to a solution for joints 1 to 5.
#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
fn extended(solution: [f64; 5], angles: Angles) -> Angles {
    let [t1, t2, t3, t4, t5] = solution.map(|angle| angle as f32);
    let [.., t6, t7] = angles;
    [t1, t2, t3, t4, t5, t6, t7]
}

/// A drag of the tip. The tip moves in the plane through its first position that is parallel to the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipDrag {
    /// The vector from the projected tip to the pointer at the start, in CSS pixels.
    offset: Vec2,
    /// The angles at the start. The tool keeps its direction from there.
    start: Angles,
}

impl TipDrag {
    /// Begins a drag of the tip. `None` if [`Camera::project`] gives no pixel for the tip.
    #[must_use]
    pub fn start(angles: Angles, camera: &Camera, pointer: Vec2) -> Option<Self> {
        Some(Self { offset: pointer - camera.project(tip_of(angles))?, start: angles })
    }

    /// Moves the pointer. Returns the wanted position of the tip and the pose for it.
    #[must_use]
    pub fn to(&self, pointer: Vec2, camera: &Camera) -> TipWish {
        wish(camera.on_facing_plane(pointer - self.offset, tip_of(self.start)), self.start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::arm::ArmMeshes;
    use crate::scene::camera::Preset;
    use kinematics::limits::check;
    use sevenbot::cartesian::FixedObstacle;

    const POSE: Angles = [90.0, 100.0, 75.0, 80.0, 110.0, 70.0, 60.0];

    /// For each joint, a point of the part that it moves, away from the axis of the joint.
    const GRIPS: [(Body, [f32; 3]); 7] = [
        (Body::Turret, [40.0, 34.0, 20.0]),
        (Body::RearArm, [0.0, 30.0, 100.0]),
        (Body::Forearm, [120.0, 0.0, 38.0]),
        (Body::Wrist, [-20.0, 12.0, 16.0]),
        (Body::Hand, [16.0, 0.0, 11.0]),
        (Body::Disc, [0.0, 19.0, 0.0]),
        (Body::Finger, [48.0, -3.0, 8.0]),
    ];

    #[test]
    fn a_dragged_joint_follows_its_point_from_every_side() {
        for preset in [Preset::Corner, Preset::Front, Preset::Side, Preset::Top] {
            let mut camera = Camera::default();
            camera.look_from(preset);
            for (body, grip) in GRIPS {
                let (local, joint) = (Vec3::from(grip), body.joint().expect("a joint"));
                let place = usize::from(joint) - 1;
                let drawn = |angle: f32| {
                    camera.project(point_of(with_joint(POSE, joint, angle), body, local)).expect("in front")
                };
                let hit = Hit { body, local, distance: 0.0 };
                let mut drag = JointDrag::start(hit, POSE, &camera, drawn(POSE[place])).expect("a joint");
                // Move the pointer to where the point is after a turn of 1 to 12 degrees. The dragged point has to end there.
                let led = POSE[place] + 12.0;
                for step in 1..=12 {
                    drag.to(drawn(POSE[place] + step as f32), POSE, &camera);
                }
                let ended = drag.to(drawn(led), POSE, &camera);
                let missed = (drawn(ended) - drawn(led)).length();
                assert!(missed < 0.6, "joint {joint} {preset:?}: {ended} instead of {led}, {missed} px");
            }
        }
    }

    #[test]
    fn a_drag_keeps_the_limits() {
        let camera = Camera::default();
        for (body, grip) in GRIPS {
            let joint = body.joint().expect("a joint");
            let hit = Hit { body, local: Vec3::from(grip), distance: 0.0 };
            for far in [[-3000.0, 50.0], [3000.0, -2000.0], [0.0, 4000.0]] {
                let pointer = camera.project(point_of(POSE, body, hit.local)).expect("in front");
                let mut drag = JointDrag::start(hit, POSE, &camera, pointer).expect("a joint");
                for step in 1..40 {
                    let towards = pointer.lerp(Vec2::from(far), step as f32 / 40.0);
                    let angle = drag.to(towards, POSE, &camera);
                    let all = with_joint(POSE, joint, angle).map(f64::from);
                    assert_eq!(check(all), Ok(()), "joint {joint} at {angle}");
                }
            }
        }
    }

    #[test]
    fn the_base_cannot_be_dragged() {
        let hit = Hit { body: Body::Base, local: Vec3::ZERO, distance: 1.0 };
        assert_eq!(JointDrag::start(hit, POSE, &Camera::default(), Vec2::ZERO), None);
    }

    #[test]
    fn a_dragged_tip_is_where_the_pointer_is_and_keeps_its_direction() {
        let camera = Camera::default();
        let start = camera.project(tip_of(POSE)).expect("in front");
        let drag = TipDrag::start(POSE, &camera, start + Vec2::new(3.0, 2.0)).expect("a tip");
        let wish = drag.to(start + Vec2::new(-27.0, 22.0), &camera);
        let angles = wish.reach.expect("within reach");
        let drawn = camera.project(tip_of(angles)).expect("in front");
        assert!((drawn - (start + Vec2::new(-30.0, 20.0))).length() < 0.1, "{drawn}");
        assert!((tip_of(angles) - wish.tip).length() < 0.01);
        let tool = |angles: Angles| point_of(angles, Body::Disc, Vec3::X) - tip_of(angles);
        assert!((tool(angles) - tool(POSE)).length() < 1e-3);
        assert_eq!(angles[5..], POSE[5..]);
    }

    #[test]
    fn a_tip_out_of_reach_is_told_with_the_nearest_pose() {
        let far = wish(Vec3::new(0.0, 600.0, 100.0), POSE);
        let unreachable = far.reach.expect_err("too far");
        let too_far = WishRefusal::OutOfReach(NoSolution::TooFar);
        assert_eq!((far.tip, unreachable.why), (Vec3::new(0.0, 600.0, 100.0), too_far));
        let nearest = unreachable.nearest.expect("a pose");
        assert_eq!(check(nearest.map(f64::from)), Ok(()));
        let gap = (tip_of(nearest) - far.tip).length();
        assert!(gap > 100.0 && gap < 350.0, "{gap}");
    }

    #[test]
    fn a_tip_below_the_table_or_in_the_base_is_refused() {
        let down: Angles = [90.0, 88.0, 110.0, 90.0, 135.0, 90.0, 80.0];
        let refused = |x: f32, y: f32, z: f32| match wish(Vec3::new(x, y, z), down).reach {
            Err(RefusedWish { why: WishRefusal::Guarded(breach), .. }) => Some(breach.obstacle),
            _ => None,
        };
        assert_eq!(refused(0.0, 185.0, -50.0), None);
        assert_eq!(refused(0.0, 185.0, -100.0), Some(FixedObstacle::Table));
        assert_eq!(refused(0.0, 100.0, -40.0), Some(FixedObstacle::Base));
    }

    #[test]
    fn what_is_picked_can_be_dragged() {
        let (arm, camera) = (ArmMeshes::default(), Camera::default());
        let pixel =
            camera.project(point_of(POSE, Body::RearArm, Vec3::new(0.0, 30.0, 60.0))).expect("in front");
        let hit = arm.pick(POSE, camera.ray(pixel)).expect("a body");
        let drag = JointDrag::start(hit, POSE, &camera, pixel).expect("a joint");
        assert_eq!(drag.clone().to(pixel, POSE, &camera), POSE[usize::from(drag.joint()) - 1]);
    }
}
