//! The nearest point within reach, rounded to tenths of a millimetre so that the rounded point is within reach too.
//!
//! If the wrist limits the reach, [`nearest_tip`] gives the point. If the bend of the hand or the guard limits it, the set
//! of allowed points has no simple shape. Then a grid search finds a point: coarse over the whole reach, then finer around
//! the best. All grid points are in tenths, because at a thin edge of the set an exact point may have no allowed neighbour
//! in tenths.

use kinematics::ik6;
use kinematics::nearest::nearest_tip;

use super::guard::Guard;
use super::target::TipTarget;
use super::{Vector, rounded};

/// Grid points in a millimetre.
const TENTHS: f64 = 10.0;
/// The spacing of the coarsest grid, in millimetres. Each finer grid has half the spacing of the previous one.
const COARSE: f64 = 256.0 * FINE;
/// Points of the coarsest grid on each side of its middle, along each axis.
const COARSE_STEPS: i32 = 16;
/// The middle of the coarsest grid: on the base axis, at about the height of the shoulder.
const MIDDLE: Vector = Vector::new(0.0, 0.0, 75.0);
/// The spacing of the finest grid, in millimetres.
const FINE: f64 = 1.0 / TENTHS;

/// The nearest point to `tip` that a search finds: within reach with the tool in this direction, and allowed by the guard. `None`
/// if the search finds none, or if `tip` is no position.
pub(super) fn nearest(tip: Vector, tool: Vector, guard: Option<&Guard>) -> Option<Vector> {
    if !tip.is_finite() {
        return None;
    }
    let wish = Wish { tip, tool, guard };
    let exact = nearest_tip(tip, tool).filter(|&point| wish.is_allowed(point));
    exact.and_then(|point| wish.best(around(point, FINE, 2))).or_else(|| wish.searched())
}

/// A requested position that the arm cannot or may not take. Searches the nearest allowed point.
struct Wish<'a> {
    tip: Vector,
    tool: Vector,
    guard: Option<&'a Guard>,
}

impl Wish<'_> {
    /// Is the point within reach, and is the arm outside every obstacle there, also after rounding to whole degrees?
    fn is_allowed(&self, point: Vector) -> bool {
        let is_clear = |angles, guard: &Guard| {
            guard.is_clear(angles)
                && TipTarget::near(angles, point, self.tool, Some(guard)).is_allowed_by(guard)
        };
        ik6(point, self.tool).is_ok_and(|angles| self.guard.is_none_or(|guard| is_clear(angles, guard)))
    }

    fn searched(&self) -> Option<Vector> {
        let mut nearest = self.best(around(MIDDLE, COARSE, COARSE_STEPS))?;
        let mut step = COARSE / 2.0;
        while step > FINE / 2.0 {
            let next = self.best(around(nearest, step, 2)).unwrap_or(nearest);
            // A better point may itself have a better neighbour.
            if self.distance(next) < self.distance(nearest) {
                nearest = next;
            } else {
                step /= 2.0;
            }
        }
        Some(nearest)
    }

    /// The allowed point among `points` that is nearest to the requested tip.
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

/// The grid round `middle`, rounded to tenths of a millimetre: `steps` points to each side.
fn around(middle: Vector, step: f64, steps: i32) -> impl Iterator<Item = Vector> {
    cube(steps).map(move |(x, y, z)| {
        let Vector { x, y, z } = middle + Vector::new(x.into(), y.into(), z.into()) * step;
        Vector::new(rounded(x, TENTHS), rounded(y, TENTHS), rounded(z, TENTHS))
    })
}

/// Whole numbers from `-steps` to `steps` in three dimensions.
fn cube(steps: i32) -> impl Iterator<Item = (i32, i32, i32)> {
    let line = move || -steps..=steps;
    line().flat_map(move |x| line().flat_map(move |y| line().map(move |z| (x, y, z))))
}

#[cfg(test)]
mod tests {
    use super::super::{DOWN, PointText};
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

    /// The point after a user has typed its printed text.
    fn typed(point: Vector) -> Vector {
        let text = PointText(point).to_string();
        let numbers: Vec<f64> = text.split(' ').map(|number| number.parse().expect("a number")).collect();
        Vector::new(numbers[0], numbers[1], numbers[2])
    }

    #[track_caller]
    fn check_typed(tip: Vector, tool: Vector) {
        for guard in [None, Some(Guard::default())] {
            if TipTarget::guarded(tip, tool, guard.as_ref()).is_err()
                && let Some(point) = nearest(tip, tool, guard.as_ref())
            {
                let typed = TipTarget::guarded(typed(point), tool, guard.as_ref());
                assert!(typed.is_ok(), "{tip:?} {tool:?}: {typed:?}");
            }
        }
    }

    #[test]
    fn nothing_is_near_to_what_is_no_position() {
        assert_eq!(nearest(Vector::new(f64::NAN, 185.0, 50.0), DOWN, None), None);
        assert_eq!(nearest(Vector::new(0.0, f64::INFINITY, 50.0), DOWN, None), None);
    }

    #[test]
    fn the_nearest_point_can_be_typed_as_it_is_printed() {
        // The reach has an edge there that is so thin that the exact point has no neighbour in tenths within reach.
        check_typed(Vector::new(256.467, 259.916, 337.429), Vector::new(-0.421_14, -0.766_053, -0.207_983));
        let mut random = 1_u32;
        let mut number = |range: f64| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (f64::from(random >> 8) / f64::from(1_u32 << 23) - 1.0) * range
        };
        for _ in 0..30 {
            let tip = Vector::new(number(500.0), number(500.0), number(400.0));
            for tool in [DOWN, Vector::new(number(1.0), number(1.0), number(1.0))] {
                check_typed(tip, tool);
            }
        }
    }
}
