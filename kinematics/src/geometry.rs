//! Dimensions and limits of the arm, from the maker's published firmware and the maker's page that draws the arm. Estimates
//! are marked.
//!
//! ```text
//!                  normal n
//!                     ▲
//!      elbow offset ┌─┴────────── forearm u ────────● wrist ── tool ──│ tip, centre of the disc
//!             elbow ●                               joints 4, 5, 6
//!                  /
//!                 / rear arm
//!                /
//!    ┌ shoulder ●       z up
//!    │                  │
//!    └──── base axis    └── heading
//! ```
//!
//! A parallelogram keeps the forearm's angle to the horizontal when joint 2 moves. The maker draws its link from the
//! lever, on the shoulder axis, to the forearm behind the elbow. The parallelogram limits the angle between rear arm and
//! forearm.
//!
//! Lengths are millimetres, angles degrees as the registers have them.

/// From the base axis to the shoulder axis, along the heading.
pub const SHOULDER_FORWARD: f64 = 29.35;
/// From the top plate up to the shoulder axis.
pub const SHOULDER_HEIGHT: f64 = 74.5;
/// From the shoulder axis to the elbow axis.
pub const REAR_ARM: f64 = 120.0;
/// From the elbow axis to the axis of the forearm, at right angles to it.
pub const ELBOW_OFFSET: f64 = 25.0;
/// Along the axis of the forearm to the wrist, where the axes of joints 4, 5 and 6 meet.
pub const FOREARM: f64 = 198.5;
/// From the wrist to the outer face of the disc that joint 6 turns.
pub const TOOL: f64 = 22.46;
/// Radius of the disc that joint 6 turns.
pub const DISC_RADIUS: f64 = 20.0;
/// From the shoulder axis to the end of the parallelogram's lever. No other point depends on this length.
pub const LEVER: f64 = 40.0;
/// From the top plate down to the foot of the base; an estimate. The foot stands on the table.
pub const BASE_HEIGHT: f64 = 60.0;
/// Radius of the foot, the widest part of the base; an estimate.
pub const BASE_RADIUS: f64 = 78.0;

/// The axes of the claw's fingers: their distance from the disc along the tool, and from the tool's axis to either side; an
/// estimate.
pub const FINGER_AXIS: [f64; 2] = [14.0, 11.0];
/// The bend of a finger with the claw closed, from the axis of the finger: along the tool, and outward; an estimate.
pub const FINGER_BEND: [f64; 2] = [22.0, 6.0];
/// The end of a finger, in the coordinates of [`FINGER_BEND`]; an estimate.
pub const FINGER_END: [f64; 2] = [52.0, -7.0];

/// From the elbow axis to the wrist: the hypotenuse of [`FOREARM`] and [`ELBOW_OFFSET`].
pub(crate) const ELBOW_TO_WRIST: f64 = 200.068_113_401_411_37;
/// The angle between the line from elbow to wrist and the axis of the forearm, in degrees.
pub(crate) const ELBOW_TO_WRIST_ANGLE: f64 = 7.178_298_211_576_967;

/// The angle of joint 3 at which the forearm is level. At larger angles it slopes down towards the wrist.
pub const LEVEL_FOREARM: f64 = 65.0;
/// The largest angle of joints 1 to 6. The smallest is 0.
pub const JOINT_MAX: f64 = 180.0;
/// The smallest value of [`linkage`](crate::limits::linkage): the elbow is as far open as the parallelogram lets it be.
pub const LINKAGE_MIN: f64 = 19.0;
/// The largest value of [`linkage`](crate::limits::linkage): the elbow is as far closed as the parallelogram lets it be.
pub const LINKAGE_MAX: f64 = 161.0;
/// The largest angle of joint 7: its servo ends at 1023 counts.
pub const CLAW_MAX: f64 = 84.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_from_elbow_to_wrist_is_that_of_its_two_parts() {
        assert!((ELBOW_TO_WRIST - FOREARM.hypot(ELBOW_OFFSET)).abs() < 1e-13);
        assert!((ELBOW_TO_WRIST_ANGLE - ELBOW_OFFSET.atan2(FOREARM).to_degrees()).abs() < 1e-13);
    }
}
