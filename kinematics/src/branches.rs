//! All solutions for a position. [`ik5`] and [`ik6`] return the first of them.
//!
//! A second one is returned only where a joint is at an end: joint 1, where y of the wrist is 0, or joint 4, where the hand
//! bends exactly to the side.

use crate::float::Float;
use crate::forward::ArmFrames;
use crate::geometry::{SHOULDER_FORWARD, SHOULDER_HEIGHT, TOOL};
use crate::inverse::{NoSolution, direction, ik5, ik6, in_plane, roll_and_bend};
use crate::limits::joint_angle;
use crate::vector::Vector;

/// All angles of joints 1 to 3, in degrees, that bring the wrist to a point in millimetres. The first solution is the one
/// of [`ik5`]. The second has joint 1 at the opposite end; `None` if there is none.
///
/// # Errors
///
/// The same as [`ik5`].
pub fn ik5_all<F: Float>(wrist: Vector<F>) -> Result<[Option<[F; 3]>; 2], NoSolution> {
    let first = ik5(wrist)?;
    Ok([Some(first), other_heading(wrist, first)])
}

/// All angles of joints 1 to 5, in degrees, that bring the tip to a point in millimetres and point the tool in a
/// direction of any length. The first solution is the one of [`ik6`]. The second has joint 4 at the opposite end. The
/// other two have joint 1 at the opposite end. A solution that does not exist is `None`.
///
/// Where the tool is in line with the forearm, joint 4 may have any angle. It gets 90 degrees.
///
/// # Errors
///
/// The same as [`ik6`].
pub fn ik6_all<F: Float>(tip: Vector<F>, tool: Vector<F>) -> Result<[Option<[F; 5]>; 4], NoSolution> {
    let [t1, t2, t3, t4, t5] = ik6(tip, tool)?;
    let tool = direction(tool, NoSolution::NoToolDirection)?;
    let (arm, hand) = ([t1, t2, t3], [t4, t5]);
    let other_arm = other_heading(tip - tool * F::of(TOOL), arm);
    let on_other_arm = other_arm.and_then(|arm| Some((arm, roll_and_bend(&ArmFrames::of(arm), tool).ok()?)));
    let with_other_roll = |(arm, hand)| Some((arm, other_roll(hand)?));
    let found = [
        Some((arm, hand)),
        with_other_roll((arm, hand)),
        on_other_arm,
        on_other_arm.and_then(with_other_roll),
    ];
    Ok(found.map(|solution| solution.map(|([t1, t2, t3], [t4, t5])| [t1, t2, t3, t4, t5])))
}

/// The solution with joint 1 half a turn from where it is.
fn other_heading<F: Float>(wrist: Vector<F>, [t1, ..]: [F; 3]) -> Option<[F; 3]> {
    let t1 = opposite(t1)?;
    let forward = wrist.dot(ArmFrames::of([t1; 3]).heading) - F::of(SHOULDER_FORWARD);
    let [t2, t3] = in_plane(forward, wrist.z - F::of(SHOULDER_HEIGHT)).ok()?;
    Some([t1, t2, t3])
}

/// Joints 4 and 5 for the same direction of the tool, with joint 4 turned by half a turn; `None` if joint 4 cannot turn there.
fn other_roll<F: Float>([t4, t5]: [F; 2]) -> Option<[F; 2]> {
    Some([opposite(t4)?, F::of(180.0) - t5])
}

/// The angle half a turn away, if a joint reaches it.
fn opposite<F: Float>(degrees: F) -> Option<F> {
    let half_turn = F::of(180.0);
    joint_angle(degrees + half_turn).or_else(|| joint_angle(degrees - half_turn))
}
