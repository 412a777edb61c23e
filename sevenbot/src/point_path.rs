//! The path of a recording as points at any time, for a stream: arithmetic without an arm or a clock.

use std::time::Duration;

use crate::recording::{Moment, Recording};

/// The straight lines between the moments of a recording, played `factor` times as fast.
///
/// ```
/// use sevenbot::{point_path::PointPath, recording::Recording};
/// use std::time::Duration;
///
/// # fn main() -> Result<(), sevenbot::recording::RecordingError> {
/// let text = "7bot-recording 2\n5 90 90 65 90 90 90 80 0\n6 90.5 90 65 90 90 90 80 1\n";
/// let mut path = PointPath::new(&Recording::parse(text)?, 0.5);
/// assert_eq!(path.duration(), Duration::from_secs(2));
/// let middle = path.at(Duration::from_secs(1)).map(|moment| moment.pose[0].to_string());
/// assert_eq!(middle.as_deref(), Some("90.25"));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct PointPath {
    /// Times start at 0 and are scaled.
    moments: Vec<Moment>,
    /// The index of the moment at or before the last point.
    index: usize,
}

impl PointPath {
    /// The path of a recording. Its times begin at 0.
    #[must_use]
    pub fn new(recording: &Recording, factor: f64) -> Self {
        let start = recording.moments().next().map_or(Duration::ZERO, |first| first.time);
        let scaled = |moment: Moment| Moment { time: (moment.time - start).div_f64(factor), ..moment };
        Self { moments: recording.moments().map(scaled).collect(), index: 0 }
    }

    /// The time of the last moment.
    #[must_use]
    pub fn duration(&self) -> Duration {
        self.moments.last().map_or(Duration::ZERO, |last| last.time)
    }

    /// The pose at `time`, which must not be earlier than in the last call; after the end, the last pose. The pump has the
    /// state of the moment at or before `time`. `None` if the path has no moments.
    pub fn at(&mut self, time: Duration) -> Option<Moment> {
        while self.moments.get(self.index + 1).is_some_and(|next| next.time <= time) {
            self.index += 1;
        }
        let from = *self.moments.get(self.index)?;
        let Some(to) = self.moments.get(self.index + 1) else { return Some(Moment { time, ..from }) };
        let share = time.saturating_sub(from.time).as_secs_f64() / (to.time - from.time).as_secs_f64();
        let mut pose = from.pose;
        for (angle, to) in pose.iter_mut().zip(to.pose) {
            *angle = angle.between(to, share);
        }
        Some(Moment { time, pose, vacuum: from.vacuum })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_points_of_a_period_are_on_straight_lines() {
        let text = "7bot-recording 1\n3 90 90 65 90 90 90 80 0\n3.05 91 90 65 90 90 90 80 1\n3.1 91 90 65 90 90 90 80 0\n";
        let mut path = PointPath::new(&Recording::parse(text).expect("a recording"), 1.0);
        let points: Vec<_> = (0..=6).filter_map(|tick| path.at(Duration::from_millis(20) * tick)).collect();
        let base: Vec<u16> = points.iter().map(|point| point.pose[0].hundredths()).collect();
        assert_eq!(base, [9_000, 9_040, 9_080, 9_100, 9_100, 9_100, 9_100]);
        let pump: Vec<bool> = points.iter().map(|point| point.vacuum).collect();
        assert_eq!(pump, [false, false, false, true, true, false, false]);
        assert_eq!(path.duration(), Duration::from_millis(100));
    }
}
