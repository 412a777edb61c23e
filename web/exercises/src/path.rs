//! Checks whether the tip follows a path.

/// The largest number of points of a path.
pub(crate) const MOST_POINTS: usize = 100;
/// The largest distance in mm between neighbouring checkpoints of a path, and between neighbouring positions that are
/// interpolated from one observation of the tip to the next.
const STEP: f64 = 2.0;
/// The largest number of steps between two observations, which makes 100 mm. After a longer distance the path between the two
/// observations is unknown, and the tip begins again.
const MOST_STEPS: u32 = 50;

type PathPoint = [f64; 3];

/// The progress of a tip along a path. The tip has to pass all checkpoints in order. If it leaves the path, it begins again.
#[derive(Clone, Debug)]
pub(crate) struct PathProgress {
    checkpoints: Vec<PathPoint>,
    within: f64,
    /// The number of checkpoints that the tip has passed.
    passed: usize,
    last: Option<PathPoint>,
}

impl PathProgress {
    pub(crate) fn new(path: &[PathPoint], within: f64) -> Self {
        let mut checkpoints: Vec<PathPoint> = path.first().copied().into_iter().collect();
        for (from, to) in path.iter().zip(path.iter().skip(1)) {
            checkpoints.extend(between(*from, *to));
        }
        Self { checkpoints, within, passed: 0, last: None }
    }

    /// Takes the position of the tip. If it is not measured (`None`), the tip has to begin the path again. Returns true at the
    /// end of the path.
    pub(crate) fn observe(&mut self, tip: Option<PathPoint>) -> bool {
        let Some(tip) = tip else {
            self.passed = 0;
            self.last = None;
            return false;
        };
        let is_near = |from: &PathPoint| distance(*from, tip) <= STEP * f64::from(MOST_STEPS);
        let from = self.last.replace(tip).filter(is_near);
        if from.is_none() {
            self.passed = 0;
        }
        between(from.unwrap_or(tip), tip).into_iter().any(|place| self.passes(place))
    }

    fn passes(&mut self, place: PathPoint) -> bool {
        let is_near = |point: &PathPoint| distance(*point, place) <= self.within;
        let ahead = self.checkpoints.iter().skip(self.passed).take_while(|point| is_near(point)).count();
        self.passed += ahead;
        // The tip may cut a corner as long as it is near the last checkpoint that it passed.
        let is_on_path = self.checkpoints.iter().take(self.passed).next_back().is_some_and(is_near);
        if !is_on_path {
            self.passed = 0;
        }
        self.passed == self.checkpoints.len()
    }
}

/// Interpolated positions from one point to another, without the first and with the last.
fn between(from: PathPoint, to: PathPoint) -> Vec<PathPoint> {
    let steps =
        (1..MOST_STEPS * 100).find(|steps| distance(from, to) <= STEP * f64::from(*steps)).unwrap_or(1);
    let place = |step| {
        let part = f64::from(step) / f64::from(steps);
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let [from, to] = [from, to].map(|point: PathPoint| point.get(axis).copied().unwrap_or(0.0));
            from + (to - from) * part
        });
        [x, y, z]
    };
    (1..=steps).map(place).collect()
}

/// The distance of two points, in mm.
pub(crate) fn distance(one: PathPoint, other: PathPoint) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: [PathPoint; 3] = [[0.0, 200.0, 50.0], [100.0, 200.0, 50.0], [100.0, 260.0, 50.0]];

    fn follow(places: &[PathPoint]) -> bool {
        let mut progress = PathProgress::new(&CORNER, 5.0);
        places.iter().any(|place| progress.observe(Some(*place)))
    }

    #[test]
    fn a_tip_that_goes_along_the_lines_completes_them() {
        assert!(follow(&CORNER));
        assert!(follow(&[&[[0.0, 150.0, 50.0]][..], &CORNER].concat()), "from elsewhere");
        assert!(follow(&[[1.0, 203.0, 52.0], [99.0, 202.0, 50.0], [101.0, 259.0, 47.0]]), "nearly");
    }

    #[test]
    fn a_tip_that_leaps_begins_anew_where_it_is() {
        let line = [[0.0, 200.0, 50.0], [150.0, 200.0, 50.0]];
        let follows = |places: &[f64]| {
            let mut progress = PathProgress::new(&line, 5.0);
            places.iter().any(|x| progress.observe(Some([*x, 200.0, 50.0])))
        };
        assert!(follows(&[0.0, 90.0, 150.0]));
        assert!(!follows(&[0.0, 150.0]), "nobody saw the way");
        assert!(!follows(&[150.0, 0.0, 150.0]));
        assert!(follows(&[150.0, 0.0, 90.0, 150.0]), "the start of the line is where it leapt to");
    }

    #[test]
    fn a_shortcut_a_lifted_pen_and_the_way_back_do_not() {
        assert!(!follow(&[CORNER[0], CORNER[2]]));
        assert!(!follow(&[CORNER[0], [50.0, 200.0, 50.0], [50.0, 200.0, 80.0], CORNER[1], CORNER[2]]));
        assert!(!follow(&[CORNER[2], CORNER[1], CORNER[0]]));
        let mut progress = PathProgress::new(&CORNER, 5.0);
        let places = [Some(CORNER[0]), Some(CORNER[1]), None, Some(CORNER[2])];
        assert!(!places.into_iter().any(|place| progress.observe(place)), "the arm was not measured between");
    }
}
