//! The nearest point within reach, rounded to tenths of a millimetre so that the rounded point is within reach too.
//!
//! If the wrist limits the reach, [`nearest_tip`] gives the point. If the bend of the hand limits it, the set of
//! points has no simple shape. Then a grid search finds a point: coarse over the whole reach, then finer around the
//! best.

use kinematics::ik6;
use kinematics::nearest::nearest_tip;

use super::Vector;

/// Points in a millimetre.
const TENTHS: f64 = 10.0;
/// The coarsest grid, in millimetres, and how many of its points are on each side of the middle.
const COARSE: f64 = 25.0;
const COARSE_STEPS: i32 = 16;
/// The middle of the coarsest grid: above the shoulder.
const MIDDLE: Vector = Vector::new(0.0, 0.0, 75.0);
/// The finest grid, in millimetres.
const FINE: f64 = 0.05;

/// The nearest point to `tip` that is within reach with the tool in this direction. `None` if there is none.
pub(super) fn nearest(tip: Vector, tool: Vector) -> Option<Vector> {
    let exact = nearest_tip(tip, tool).or_else(|| searched(tip, tool))?;
    Some(in_tenths(exact, tip, tool).unwrap_or(exact))
}

/// The point in tenths of a millimetre beside `exact` that is nearest to `tip`.
fn in_tenths(exact: Vector, tip: Vector, tool: Vector) -> Option<Vector> {
    let tenths = |number: f64, step: i32| ((number * TENTHS).round() + f64::from(step)) / TENTHS;
    let candidates =
        cube(2).map(|(x, y, z)| Vector::new(tenths(exact.x, x), tenths(exact.y, y), tenths(exact.z, z)));
    best(candidates, tip, tool)
}

fn searched(tip: Vector, tool: Vector) -> Option<Vector> {
    let round = |middle: Vector, step: f64, steps: i32| {
        cube(steps).map(move |(x, y, z)| middle + Vector::new(x.into(), y.into(), z.into()) * step)
    };
    let mut nearest = best(round(MIDDLE, COARSE, COARSE_STEPS), tip, tool)?;
    let mut step = COARSE / 2.0;
    while step > FINE {
        let next = best(round(nearest, step, 2), tip, tool).unwrap_or(nearest);
        // A better point may itself have a better neighbour.
        if (next - tip).length() < (nearest - tip).length() {
            nearest = next;
        } else {
            step /= 2.0;
        }
    }
    Some(nearest)
}

/// The nearest of the points that are within reach.
fn best(points: impl Iterator<Item = Vector>, tip: Vector, tool: Vector) -> Option<Vector> {
    let distance = |point: Vector| (point - tip).length();
    points
        .filter(|&point| ik6(point, tool).is_ok())
        .reduce(|nearest, point| if distance(point) < distance(nearest) { point } else { nearest })
}

/// Whole numbers from `-steps` to `steps` in three dimensions.
fn cube(steps: i32) -> impl Iterator<Item = (i32, i32, i32)> {
    let line = move || -steps..=steps;
    line().flat_map(move |x| line().flat_map(move |y| line().map(move |z| (x, y, z))))
}

#[cfg(test)]
mod tests {
    use super::super::DOWN;
    use super::*;

    #[test]
    fn the_nearest_point_is_in_tenths_and_within_reach() {
        for (x, y, z) in [(0.0, 500.0, 50.0), (400.0, 300.0, -100.0), (0.0, 50.0, 0.0), (0.0, -200.0, 100.0)]
        {
            let tip = Vector::new(x, y, z);
            let found = nearest(tip, DOWN).expect("one");
            assert!(ik6(found, DOWN).is_ok());
            for number in [found.x, found.y, found.z] {
                assert!((number * TENTHS - (number * TENTHS).round()).abs() < 1e-6, "{found:?}");
            }
        }
    }

    #[test]
    fn the_search_finds_what_the_exact_solution_does() {
        for (x, y, z) in [(0.0, 500.0, 50.0), (300.0, 300.0, -50.0), (-350.0, 100.0, 120.0)] {
            let tip = Vector::new(x, y, z);
            let exact = nearest_tip(tip, DOWN).expect("one");
            let found = searched(tip, DOWN).expect("one");
            let (exact, found) = ((exact - tip).length(), (found - tip).length());
            assert!(found >= exact - 1e-9 && found < exact + 1.0, "{found} {exact}");
        }
    }

    #[test]
    fn where_the_hand_cannot_bend_a_point_beside_is_found() {
        let (tip, up) = (Vector::new(100.0, 200.0, 150.0), -DOWN);
        assert_eq!(nearest_tip(tip, up), None);
        let found = nearest(tip, up).expect("one");
        assert!(ik6(found, up).is_ok() && (found - tip).length() < 250.0, "{found:?}");
    }
}
