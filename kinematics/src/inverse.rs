//! Inverse kinematics in closed form: angles of the joints that bring the arm to a position.
//!
//! ```text
//!   IK6:  wrist = tip - tool × 22.46 mm ──▶ IK5 ──▶ T1, T2, T3
//!         tool in the forearm's frame ────────────▶ T4, T5
//!   IK7:  disc in the hand's frame ───────────────▶ T6
//! ```
//!
//! Two headings bring the wrist to a point: towards the point, and away from it, with the wrist behind the base axis. Joint 1
//! reaches one of these headings, or both where y is 0. The parallelogram allows one of the two bends of the elbow, and joint 4
//! one of the two rolls of the hand. So there is at most one solution, except in the cases that [`ik5`] and [`ik6`] name.

use crate::float::Float;
use crate::forward::{ArmFrames, HandFrames};
use crate::geometry::{
    ELBOW_TO_WRIST, ELBOW_TO_WRIST_ANGLE, LEVEL_FOREARM, LINKAGE_MAX, LINKAGE_MIN, REAR_ARM,
    SHOULDER_FORWARD, SHOULDER_HEIGHT, TOOL,
};
use crate::limits::{TOLERANCE, joint_angle};
use crate::vector::Vector;

/// A wrist that is nearer than this to the base axis, in mm, has no heading.
pub(crate) const NO_HEADING: f64 = 0.001;

/// Why no angles of the joints reach a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoSolution {
    /// The wrist is too far from the shoulder: the linkage allows at most 318.47 mm.
    TooFar,
    /// The wrist is too near to the shoulder: the linkage needs at least 106.47 mm.
    TooNear,
    /// The joint of this number, 1 to 3, would have to turn beyond 0 or 180 degrees.
    Joint(u8),
    /// The wrist is within reach, but the hand cannot bend far enough back for the direction of the tool.
    ToolDirection,
    /// The wrist is on the base axis, where joint 1 has no defined angle.
    NoHeading,
    /// The direction of the tool is zero.
    NoToolDirection,
    /// The direction of the disc is zero or parallel to the tool.
    NoDiscDirection,
    /// A number is infinite or NaN.
    NotFinite,
}

/// The angles of joints 1 to 3, in degrees, that bring the wrist to a point in millimetres.
///
/// Where y is 0 and both headings lead there, the solution faces the point.
///
/// # Errors
///
/// Why the arm cannot reach the point with the heading towards it. The first reason in this order is returned: a number that is
/// not finite, no heading, the distance, joint 2, joint 3, joint 1.
pub fn ik5<F: Float>(wrist: Vector<F>) -> Result<[F; 3], NoSolution> {
    with_either_heading(wrist, Ok)
}

/// The angles of joints 1 to 5, in degrees, that bring the tip to a point in millimetres and point the tool in a
/// direction of any length.
///
/// Where y of the wrist is 0 and both headings lead there, the solution faces the wrist, if the hand can then point the
/// tool in that direction. Where the tool is in line with the forearm, joint 4 may have any angle, and gets 90 degrees.
/// Where the hand bends to the side, joint 4 may be 0 or 180 degrees, and gets the one with joint 5 below 90.
///
/// # Errors
///
/// [`NoSolution::NoToolDirection`] for a direction of zero, [`NoSolution::NotFinite`] for an infinite one or NaN, the reasons of
/// [`ik5`] for the wrist, or [`NoSolution::ToolDirection`] if the hand cannot point there.
pub fn ik6<F: Float>(tip: Vector<F>, tool: Vector<F>) -> Result<[F; 5], NoSolution> {
    let Reach { arm: [t1, t2, t3], hand: [t4, t5], .. } = Reach::of(tip, tool)?;
    Ok([t1, t2, t3, t4, t5])
}

/// The angles of joints 1 to 6, in degrees, that bring the tip to a point in millimetres, point the tool in a direction
/// of any length, and turn the disc in the direction of `disc`. Only the part of `disc` at right angles to the tool
/// counts.
///
/// A claw is the same after half a turn, so joint 6 gets 0 to 180 degrees and the disc may point the opposite way.
///
/// # Errors
///
/// The reasons of [`ik6`], or [`NoSolution::NoDiscDirection`].
pub fn ik7<F: Float>(tip: Vector<F>, tool: Vector<F>, disc: Vector<F>) -> Result<[F; 6], NoSolution> {
    let Reach { arm: [t1, t2, t3], hand: [t4, t5], frames } = Reach::of(tip, tool)?;
    let disc = direction(disc, NoSolution::NoDiscDirection)?;
    let hand = HandFrames::of(&frames, [t4, t5, F::of(0.0)]);
    let (ahead, right) = (disc.dot(hand.disc_zero), disc.dot(hand.disc_right));
    if ahead.abs().larger(right.abs()) < rounding() {
        return Err(NoSolution::NoDiscDirection);
    }
    Ok([t1, t2, t3, t4, t5, half_turns_removed(right.atan2(ahead))])
}

/// Angles of joints 1 to 5, and the frames of the arm.
struct Reach<F> {
    arm: [F; 3],
    hand: [F; 2],
    frames: ArmFrames<F>,
}

impl<F: Float> Reach<F> {
    fn of(tip: Vector<F>, tool: Vector<F>) -> Result<Self, NoSolution> {
        let tool = direction(tool, NoSolution::NoToolDirection)?;
        with_either_heading(tip - tool * F::of(TOOL), |arm| {
            let frames = ArmFrames::of(arm);
            Ok(Self { arm, hand: roll_and_bend(&frames, tool)?, frames })
        })
    }
}

/// Solves joints 1 to 3 for a wrist, then calls `rest`. Tries a base that points towards the wrist first, then one that
/// points away from it.
fn with_either_heading<F: Float, T>(
    wrist: Vector<F>,
    rest: impl Fn([F; 3]) -> Result<T, NoSolution>,
) -> Result<T, NoSolution> {
    if !wrist.is_finite() {
        return Err(NoSolution::NotFinite);
    }
    let radius = (wrist.x * wrist.x + wrist.y * wrist.y).sqrt();
    if radius < F::of(NO_HEADING) {
        return Err(NoSolution::NoHeading);
    }
    let solve = |heading: F, radius: F| {
        let [t2, t3] = in_plane(radius - F::of(SHOULDER_FORWARD), wrist.z - F::of(SHOULDER_HEIGHT))?;
        rest([joint(1, heading)?, t2, t3])
    };
    let towards = unwrapped(wrist.y.atan2(wrist.x));
    let away = unwrapped(if towards > F::of(0.0) { towards - half_turn() } else { towards + half_turn() });
    solve(towards, radius).or_else(|why| {
        solve(away, -radius).map_err(|other| match other {
            // With this heading only the hand fails, so its reason is the better one.
            NoSolution::ToolDirection => other,
            _ => why,
        })
    })
}

/// Angles of joints 2 and 3 for a wrist in the plane of the arm: `forward` of the shoulder and `up` from it, in mm.
pub(crate) fn in_plane<F: Float>(forward: F, up: F) -> Result<[F; 2], NoSolution> {
    let (one, rear_arm, rest) = (F::of(1.0), F::of(REAR_ARM), F::of(ELBOW_TO_WRIST));
    let squares = F::of(REAR_ARM * REAR_ARM + ELBOW_TO_WRIST * ELBOW_TO_WRIST);
    // The elbow's angle by the law of cosines. A cosine outside -1 to 1, infinite ones too, becomes 180 or 0 degrees.
    let cosine = (squares - (forward * forward + up * up)) / F::of(2.0 * REAR_ARM * ELBOW_TO_WRIST);
    let sine = ((one - cosine) * (one + cosine)).larger(F::of(0.0)).sqrt();
    let linkage = F::of(180.0 + ELBOW_TO_WRIST_ANGLE) - sine.atan2(cosine);
    if linkage < F::of(LINKAGE_MIN - TOLERANCE) {
        return Err(NoSolution::TooFar);
    }
    if linkage > F::of(LINKAGE_MAX + TOLERANCE) {
        return Err(NoSolution::TooNear);
    }
    // Seen from the shoulder, the rear arm is above the wrist by the angle of the point (ahead, above).
    let (ahead, above) = (rear_arm - rest * cosine, rest * sine);
    let t2 = unwrapped((up * ahead + forward * above).atan2(forward * ahead - up * above));
    Ok([joint(2, t2)?, joint(3, linkage + F::of(LEVEL_FOREARM) - t2)?])
}

/// Angles of joints 4 and 5 that point the tool in a direction of length 1.
pub(crate) fn roll_and_bend<F: Float>(arm: &ArmFrames<F>, tool: Vector<F>) -> Result<[F; 2], NoSolution> {
    let zero = F::of(0.0);
    let (up, right, along) = (tool.dot(arm.normal), -tool.dot(arm.left), tool.dot(arm.along));
    let sideways = (up * up + right * right).sqrt();
    let bend = along.atan2(sideways);
    let [t4, t5] = if sideways < rounding() {
        [F::of(90.0), bend]
    } else if up > -rounding::<F>() {
        [up.larger(zero).atan2(right), bend]
    } else {
        [(-up).atan2(-right), half_turn::<F>() - bend]
    };
    joint_angle(t5).map(|t5| [t4, t5]).ok_or(NoSolution::ToolDirection)
}

/// The vector scaled to length 1. Fails with `none` if the vector is zero, and with [`NoSolution::NotFinite`] if a component is
/// infinite or NaN.
pub(crate) fn direction<F: Float>(vector: Vector<F>, none: NoSolution) -> Result<Vector<F>, NoSolution> {
    if vector.is_finite() { vector.unit().ok_or(none) } else { Err(NoSolution::NotFinite) }
}

/// The angle, if the joint of this number can take it. Removes rounding beyond a limit.
fn joint<F: Float>(number: u8, degrees: F) -> Result<F, NoSolution> {
    joint_angle(degrees).ok_or(NoSolution::Joint(number))
}

/// Components of a direction of length 1 that are smaller than this are rounding errors.
fn rounding<F: Float>() -> F {
    F::EPSILON * F::of(16.0)
}

fn half_turn<F: Float>() -> F {
    F::of(180.0)
}

/// Turns an angle of -180 degrees into 180: rounding decides which of the two it is.
fn unwrapped<F: Float>(degrees: F) -> F {
    if degrees < F::of(TOLERANCE - 180.0) { degrees + F::of(360.0) } else { degrees }
}

/// An angle of -180 to 180 degrees modulo 180: 0 to 180, with 180 and what rounds to it turned into 0.
fn half_turns_removed<F: Float>(degrees: F) -> F {
    let zero = F::of(0.0);
    let positive = if degrees < zero { degrees + half_turn() } else { degrees.larger(zero) };
    if positive > half_turn::<F>() * (F::of(1.0) - rounding()) { zero } else { positive }
}
