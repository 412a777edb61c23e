//! The nearest point within reach, for a point out of reach.
//!
//! In the plane of the arm, six arcs bound the wrist's reach. Each arc holds one limit:
//!
//! ```text
//!   T2 = 0, T2 = 180            circle round the elbow, which stands still
//!   T3 = 0, T3 = 180            circle round shoulder + (wrist - elbow), since the forearm keeps its direction
//!   linkage = 19, linkage = 161 circle round the shoulder
//! ```
//!
//! Joint 1 turns the plane. The nearest point is in the plane through the requested point, or in a plane at an end of joint 1.
//! In a plane, it is the projection of the requested point on the plane, its projection on an arc, or a corner between two
//! arcs.

use core::iter::once;

use crate::float::Float;
use crate::forward::ArmFrames;
use crate::geometry::TOOL;
use crate::inverse::{NO_HEADING, ik5, ik6};
use crate::limits::joint_angle;
use crate::vector::Vector;

#[derive(Clone, Copy)]
enum Centre {
    Elbow,
    ForearmAtShoulder,
    Shoulder,
}

/// The arcs in order round the reach. Each begins at these angles of joints 2 and 3, where the previous one ends.
const ARCS: [(Centre, f64, f64); 6] = [
    (Centre::Elbow, 0.0, 84.0),
    (Centre::ForearmAtShoulder, 0.0, 180.0),
    (Centre::Shoulder, 46.0, 180.0),
    (Centre::Elbow, 180.0, 46.0),
    (Centre::ForearmAtShoulder, 180.0, 0.0),
    (Centre::Shoulder, 84.0, 0.0),
];

/// The point nearest to `wrist` that [`ik5`] solves, in mm. `None` if a number is infinite or NaN.
#[must_use]
pub fn nearest_wrist<F: Float>(wrist: Vector<F>) -> Option<Vector<F>> {
    if !wrist.is_finite() {
        return None;
    }
    let half_turn = F::of(180.0);
    let azimuth = wrist.y.atan2(wrist.x);
    let headings = [azimuth, azimuth + half_turn, F::of(0.0), half_turn].into_iter().filter_map(joint_angle);
    // For a point on the base axis, which has no heading.
    let beside = wrist + Vector::new(F::of(2.0 * NO_HEADING), F::of(0.0), F::of(0.0));
    let points = [wrist, beside].into_iter().chain(headings.flat_map(|heading| in_plane(heading, wrist)));
    let distance = |point: Vector<F>| (point - wrist).length();
    points
        .filter(|&point| ik5(point).is_ok())
        .reduce(|nearest, point| if distance(point) < distance(nearest) { point } else { nearest })
}

/// The position nearest to `tip` at which the tool can point in this direction, in mm. `None` if the hand cannot bend
/// that far at the wrist's nearest position, if the direction is zero, or if a number is infinite or NaN.
#[must_use]
pub fn nearest_tip<F: Float>(tip: Vector<F>, tool: Vector<F>) -> Option<Vector<F>> {
    let from_wrist = tool.unit()? * F::of(TOOL);
    let nearest = nearest_wrist(tip - from_wrist)? + from_wrist;
    ik6(nearest, tool).is_ok().then_some(nearest)
}

/// The candidates for the point nearest to `wrist` with joint 1 at `heading`: the projection of `wrist` on the plane, and
/// points on all arcs.
fn in_plane<F: Float>(heading: F, wrist: Vector<F>) -> impl Iterator<Item = Vector<F>> {
    let left = ArmFrames::of([heading; 3]).left;
    let projection = wrist - left * wrist.dot(left);
    let on_arcs = ARCS.into_iter().flat_map(move |(centre, t2, t3)| {
        let arm = ArmFrames::of([heading, F::of(t2), F::of(t3)]);
        let centre = match centre {
            Centre::Elbow => arm.elbow,
            Centre::ForearmAtShoulder => arm.shoulder + arm.wrist - arm.elbow,
            Centre::Shoulder => arm.shoulder,
        };
        let radius = (arm.wrist - centre).length();
        let on_arc = (projection - centre).unit().map(|direction| centre + direction * radius);
        once(arm.wrist).chain(on_arc)
    });
    once(projection).chain(on_arcs)
}
