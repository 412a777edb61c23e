//! A movement as a time line: the pose of the arm at each moment, and the block of the program that runs then.

use std::time::Duration;

use block_programs::BlockId;
use sevenbot::recording::{Moment, Recording};

/// The arm at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    /// The time since the program began, or the time in the recording.
    pub time: Duration,
    /// Angles of joints 1 to 7, in degrees.
    pub angles: [f32; 7],
    /// The block of the program that runs at this moment; `None` for a recording, and before the first block.
    pub block: Option<BlockId>,
}

/// A movement that a person can browse.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeLine {
    /// Ordered by time.
    stands: Vec<Stand>,
}

impl TimeLine {
    /// The moments of a recording. They belong to no block.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let stand = |Moment { time, pose, .. }: Moment| Stand {
            time,
            angles: pose.map(|angle| f32::from(angle.hundredths()) / 100.0),
            block: None,
        };
        Self { stands: recording.moments().map(stand).collect() }
    }

    /// Adds a moment, which has to be later than all earlier ones.
    pub fn push(&mut self, stand: Stand) {
        self.stands.push(stand);
    }

    /// The time of the last moment.
    #[must_use]
    pub fn length(&self) -> Duration {
        self.stands.last().map_or(Duration::ZERO, |last| last.time)
    }

    /// The arm at `time`, linearly interpolated between two moments. Before the first and after the last moment, the arm stands.
    /// `None` for a time line without moments.
    #[must_use]
    pub fn at(&self, time: Duration) -> Option<Stand> {
        let next = self.stands.partition_point(|stand| stand.time <= time);
        let before = self.stands.get(next.saturating_sub(1))?;
        let Some(after) = self.stands.get(next).filter(|_| next > 0) else {
            return Some(before.clone());
        };
        let part = (time - before.time).div_duration_f32(after.time - before.time);
        let mut angles = before.angles;
        for (angle, target) in angles.iter_mut().zip(after.angles) {
            *angle += (target - *angle) * part;
        }
        Some(Stand { time, angles, block: before.block.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn time_line() -> TimeLine {
        let text = "7bot-recording 1\n1 90 90 65 90 90 90 80 0\n3 110 90 65 90 90 90 40 1\n";
        TimeLine::of(&Recording::parse(text).expect("a recording"))
    }

    #[test]
    fn between_two_moments_the_arm_is_on_its_way() {
        let time_line = time_line();
        assert_eq!(time_line.length(), Duration::from_secs(3));
        for (millis, joints) in
            [(0, [90.0, 80.0]), (1_000, [90.0, 80.0]), (1_500, [95.0, 70.0]), (3_000, [110.0, 40.0])]
        {
            let stand = time_line.at(Duration::from_millis(millis)).expect("moments");
            assert_eq!([stand.angles[0], stand.angles[6]], joints, "{millis}");
        }
        assert_eq!(time_line.at(Duration::from_secs(9)).expect("moments").angles[0], 110.0);
        assert_eq!(TimeLine::default().at(Duration::ZERO), None);
    }
}
