//! Measurements of the last seconds.

use std::collections::VecDeque;

/// The quantity that a plot shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlottedQuantity {
    /// Measured angle, in degrees.
    Angle,
    /// Load, in percent of the stall torque.
    Load,
    /// Velocity, in degrees per second.
    Velocity,
}

/// The state of joints 1 to 7 at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// The time in seconds, from any fixed instant.
    pub time: f64,
    /// The angles in degrees.
    pub angles: [f32; 7],
    /// The loads in percent of the stall torque, positive towards greater angles.
    pub loads: [f32; 7],
    /// The velocities in degrees per second, positive towards greater angles.
    pub velocities: [f32; 7],
}

impl Sample {
    /// The values of one quantity, joint 1 first.
    #[must_use]
    pub const fn values(&self, quantity: PlottedQuantity) -> &[f32; 7] {
        match quantity {
            PlottedQuantity::Angle => &self.angles,
            PlottedQuantity::Load => &self.loads,
            PlottedQuantity::Velocity => &self.velocities,
        }
    }
}

/// Samples of the last seconds, oldest first.
#[derive(Clone, Debug)]
pub struct History {
    seconds: f64,
    samples: VecDeque<Sample>,
}

impl History {
    /// The largest number of samples: 20 seconds at 100 samples per second.
    pub const CAPACITY: usize = 2_000;

    /// An empty history that keeps samples for this many seconds.
    #[must_use]
    pub const fn new(seconds: f64) -> Self {
        Self { seconds, samples: VecDeque::new() }
    }

    /// How long samples are kept, in seconds.
    #[must_use]
    pub const fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Adds a sample and drops those that are too old. A sample that is older than the last one clears the history first: the
    /// clock has started again, with another source or a new simulator.
    pub fn push(&mut self, sample: Sample) {
        if self.samples.back().is_some_and(|last| last.time > sample.time) {
            self.samples.clear();
        }
        self.samples.push_back(sample);
        let is_old = |oldest: &Sample| sample.time - oldest.time > self.seconds;
        while self.samples.len() > Self::CAPACITY || self.samples.front().is_some_and(is_old) {
            self.samples.pop_front();
        }
    }

    /// All samples, oldest first.
    pub fn samples(&self) -> impl DoubleEndedIterator<Item = &Sample> {
        self.samples.iter()
    }

    /// The time of the last sample, in seconds; 0 for an empty history.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.samples.back().map_or(0.0, |sample| sample.time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time: f64) -> Sample {
        Sample { time, ..Sample::default() }
    }

    #[test]
    fn old_samples_are_dropped() {
        let mut history = History::new(10.0);
        (0..=25).for_each(|second| history.push(at(f64::from(second))));
        let times: Vec<f64> = history.samples().map(|sample| sample.time).collect();
        assert_eq!((times.first(), times.len(), history.end()), (Some(&15.0), 11, 25.0));
    }

    #[test]
    fn the_memory_is_bounded() {
        let mut history = History::new(1e9);
        (0..5_000).for_each(|time| history.push(at(f64::from(time))));
        assert_eq!(history.samples().count(), History::CAPACITY);
    }

    #[test]
    fn time_that_goes_back_begins_a_new_history() {
        let mut history = History::new(10.0);
        history.push(at(5.0));
        history.push(at(1.0));
        assert_eq!(history.samples().map(|sample| sample.time).collect::<Vec<_>>(), [1.0]);
    }
}
