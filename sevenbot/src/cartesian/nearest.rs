//! The nearest point within reach, rounded to tenths of a millimetre so that the rounded point is within reach too.
//!
//! If the wrist limits the reach, [`nearest_tip`] gives the point. If the bend of the hand or the guard limits it, the set
//! of points has no simple shape. Then a grid search finds a point: coarse over the whole reach, then finer around the
//! best.

use kinematics::ik6;
use kinematics::nearest::nearest_tip;

use super::Vector;
use super::guard::Guard;
use super::target::TipTarget;

/// Points in a millimetre.
const TENTHS: f64 = 10.0;
/// The coarsest grid, in millimetres, and how many of its points are on each side of the middle.
const COARSE: f64 = 25.0;
const COARSE_STEPS: i32 = 16;
/// The middle of the coarsest grid: above the shoulder.
const MIDDLE: Vector = Vector::new(0.0, 0.0, 75.0);
/// The finest grid, in millimetres.
const FINE: f64 = 0.05;

/// The nearest point to `tip` that is within reach with the tool in this direction, and that the guard allows. `None` if
/// there is none.
pub(super) fn nearest(tip: Vector, tool: Vector, guard: Option<&Guard>) -> Option<Vector> {
    let wish = Wish { tip, tool, guard };
    let exact = nearest_tip(tip, tool).filter(|&point| wish.is_allowed(point)).or_else(|| wish.searched())?;
    Some(wish.in_tenths(exact).unwrap_or(exact))
}

/// A position that cannot be, and what is allowed instead.
struct Wish<'a> {
    tip: Vector,
    tool: Vector,
    guard: Option<&'a Guard>,
}

impl Wish<'_> {
    /// Is the point within reach, and outside every obstacle? For an arm that takes whole degrees, too.
    fn is_allowed(&self, point: Vector) -> bool {
        let is_clear = |angles, guard: &Guard| {
            guard.is_clear(angles)
                && TipTarget::near(angles, point, self.tool, Some(guard)).is_allowed_by(guard)
        };
        ik6(point, self.tool).is_ok_and(|angles| self.guard.is_none_or(|guard| is_clear(angles, guard)))
    }

    /// The point in tenths of a millimetre beside `exact` that is nearest to the tip.
    fn in_tenths(&self, exact: Vector) -> Option<Vector> {
        let tenths = |number: f64, step: i32| ((number * TENTHS).round() + f64::from(step)) / TENTHS;
        let candidates =
            cube(2).map(|(x, y, z)| Vector::new(tenths(exact.x, x), tenths(exact.y, y), tenths(exact.z, z)));
        self.best(candidates)
    }

    fn searched(&self) -> Option<Vector> {
        let round = |middle: Vector, step: f64, steps: i32| {
            cube(steps).map(move |(x, y, z)| middle + Vector::new(x.into(), y.into(), z.into()) * step)
        };
        let mut nearest = self.best(round(MIDDLE, COARSE, COARSE_STEPS))?;
        let mut step = COARSE / 2.0;
        while step > FINE {
            let next = self.best(round(nearest, step, 2)).unwrap_or(nearest);
            // A better point may itself have a better neighbour.
            if self.distance(next) < self.distance(nearest) {
                nearest = next;
            } else {
                step /= 2.0;
            }
        }
        Some(nearest)
    }

    /// The nearest of the points that are allowed.
    fn best(&self, points: impl Iterator<Item = Vector>) -> Option<Vector> {
        let mut best: Option<Vector> = None;
        for point in points {
            // The distance is cheaper than the check.
            let is_nearer = best.is_none_or(|best| self.distance(point) < self.distance(best));
            if is_nearer && self.is_allowed(point) {
                best = Some(point);
            }
        }
        best
    }

    fn distance(&self, point: Vector) -> f64 {
        (point - self.tip).length()
    }
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
            let found = nearest(tip, DOWN, None).expect("one");
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
            let found = Wish { tip, tool: DOWN, guard: None }.searched().expect("one");
            let (exact, found) = ((exact - tip).length(), (found - tip).length());
            assert!(found >= exact - 1e-9 && found < exact + 1.0, "{found} {exact}");
        }
    }

    #[test]
    fn where_the_hand_cannot_bend_a_point_beside_is_found() {
        let (tip, up) = (Vector::new(100.0, 200.0, 150.0), -DOWN);
        assert_eq!(nearest_tip(tip, up), None);
        let found = nearest(tip, up, None).expect("one");
        assert!(ik6(found, up).is_ok() && (found - tip).length() < 250.0, "{found:?}");
    }
}
