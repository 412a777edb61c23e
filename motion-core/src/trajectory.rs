//! The set-point of one joint during a move or in a stream ([D10](protocol_core::decisions#d10),
//! [D11](protocol_core::decisions#d11), [D18](protocol_core::decisions#d18), [D23](protocol_core::decisions#d23)).
//!
//! Each control cycle advances the set-point by one step. A late call delays a move; it never makes a step larger. After
//! a late call in a stream, a step may be as large as the speed of the joint allows. This file does not know the joint,
//! its measured position or its servo.

use protocol_core::time::{Duration, Instant};

use crate::calibration::MicroDegrees;
use crate::point_stream::PointStream;

/// Control cycles in one unit of the time registers: 100 ms at 100 Hz.
const CYCLES_PER_TIME_UNIT: u16 = 10;
/// Step of one control cycle for each unit of the speed registers, in millionths of a degree: 1.9 degrees/s at 100 Hz
/// ([D10](protocol_core::decisions#d10)).
const STEP_PER_SPEED_UNIT: i32 = 19_000;
/// Step of one control cycle at the motor's maximum, in millionths of a degree: 62 rpm are 372 degrees/s
/// ([D10](protocol_core::decisions#d10)).
const LARGEST_STEP: i32 = 3_720_000;

/// The set-point of one joint and its target.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Trajectory {
    set_point: MicroDegrees,
    /// The target; in a stream its newest point.
    target: MicroDegrees,
    /// Remaining cycles of a timed move, at least 1; 0 for a move without a time.
    cycles_left: u16,
    stream: PointStream,
}

impl Trajectory {
    /// A trajectory at rest at `angle`.
    #[must_use]
    pub const fn holding(angle: MicroDegrees) -> Self {
        Self { set_point: angle, target: angle, cycles_left: 0, stream: PointStream::NONE }
    }

    /// Where the joint has to be now, on its way to the target.
    #[must_use]
    pub const fn set_point(&self) -> MicroDegrees {
        self.set_point
    }

    /// The target; in a stream its newest point.
    #[must_use]
    pub const fn target(&self) -> MicroDegrees {
        self.target
    }

    /// Is the set-point still on its way to the target?
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.set_point != self.target
    }

    /// Starts a move from the present set-point to `target`, and ends a stream. `time` is the joint's time register, 0 to 100
    /// times 100 ms; it counts while the joint's speed register is 0.
    pub fn move_to(&mut self, target: MicroDegrees, time: u8) {
        self.target = target;
        self.cycles_left = u16::from(time) * CYCLES_PER_TIME_UNIT;
        self.stream.end();
    }

    /// Adds the next point of a stream, whose frame came at `now`.
    pub fn stream_to(&mut self, target: MicroDegrees, now: Instant, period: Duration) {
        self.target = target;
        self.cycles_left = 0;
        self.stream.push(now, period, target);
    }

    /// Continues from `angle` to the same target.
    pub fn rebase(&mut self, angle: MicroDegrees) {
        self.set_point = angle;
    }

    /// Advances the set-point by the control cycle that ends at `end`. `speed` is the joint's present speed register, 0 to
    /// 100 times 1.9 degrees/s.
    pub fn advance(&mut self, end: Instant, speed: u8) {
        let most = if speed == 0 { LARGEST_STEP } else { i32::from(speed) * STEP_PER_SPEED_UNIT };
        if !self.stream.is_empty() {
            return self.advance_stream(end, most);
        }
        let distance = self.target.0 - self.set_point.0;
        let step = match (speed, self.cycles_left) {
            // The remaining distance divided by the remaining cycles gives a constant speed without drift.
            (0, cycles @ 1..) => (distance.abs() / i32::from(cycles)).min(most),
            _ => most,
        };
        self.step(distance, step);
        if self.cycles_left > 1 {
            self.cycles_left -= 1;
        }
    }

    /// Advances the set-point along the stream by at most `most`. If that is too slow, the set-point goes towards the newest
    /// point.
    fn advance_stream(&mut self, end: Instant, most: i32) {
        let mut wanted = self.stream.follow(self.set_point, end);
        if self.set_point.0.abs_diff(wanted.0) > most.unsigned_abs() {
            self.stream.skip_to_newest();
            wanted = self.target;
        }
        self.step(wanted.0 - self.set_point.0, most);
    }

    fn step(&mut self, distance: i32, most: i32) {
        // Without `clamp`, which contains a panic path.
        self.set_point.0 += distance.min(most).max(-most);
    }

    /// Moves the set-point at once to `angle`, where the joint is already, as far as that is on the way to the target.
    pub fn catch_up(&mut self, angle: MicroDegrees) {
        let [low, high] = [self.set_point.min(self.target), self.set_point.max(self.target)];
        self.set_point = angle.max(low).min(high);
    }

    /// Takes back the part of the last step beyond `set_point`, because the joint has to wait
    /// ([D25](protocol_core::decisions#d25)) or to give way ([D27](protocol_core::decisions#d27)). The time of a timed move does
    /// not pass meanwhile.
    pub fn hold_back(&mut self, set_point: MicroDegrees) {
        self.set_point = set_point;
        if self.cycles_left > 0 {
            self.cycles_left += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(degrees: u8) -> MicroDegrees {
        MicroDegrees::from_degrees(degrees)
    }

    /// Cycles until the move is over, and the largest step on the way.
    fn run(from: u8, to: u8, speed: u8, time: u8) -> (u32, i32) {
        let mut trajectory = Trajectory::holding(degrees(from));
        trajectory.move_to(degrees(to), time);
        let (mut cycles, mut largest) = (0, 0);
        while trajectory.is_moving() {
            let before = trajectory.set_point().0;
            trajectory.advance(Instant::ZERO, speed);
            largest = largest.max((trajectory.set_point().0 - before).abs());
            cycles += 1;
            assert!(cycles < 20_000, "the move does not end");
        }
        assert_eq!(trajectory.set_point(), degrees(to));
        (cycles, largest)
    }

    #[test]
    fn d10_speed_counts_in_steps_of_one_point_nine_degrees_a_second() {
        // 95 degrees at 50 x 1.9 = 95 degrees/s: one second.
        assert_eq!(run(0, 95, 50, 0), (100, 950_000));
        assert_eq!(run(95, 0, 50, 0), (100, 950_000), "both ways");
        assert_eq!(run(0, 19, 1, 0).0, 1_000);
    }

    #[test]
    fn d10_speed_zero_is_62_rpm() {
        let (cycles, step) = run(0, 180, 0, 0);
        assert_eq!(step, 3_720_000);
        assert_eq!(cycles, 49, "180 degrees at 372 degrees/s are 484 ms");
    }

    #[test]
    fn d11_a_timed_move_lasts_its_time_at_constant_speed() {
        for (from, to) in [(0, 180), (180, 0), (90, 91), (10, 77)] {
            for time in 5..=100 {
                let (cycles, step) = run(from, to, 0, time);
                assert_eq!(cycles, u32::from(time) * 10, "{from} to {to} in {time}");
                let even = i32::from(from.abs_diff(to)) * 1_000_000 / i32::from(time) / 10;
                assert!((step - even).abs() <= 1, "{step} is not {even}");
            }
        }
    }

    #[test]
    fn d11_too_short_a_time_is_extended_to_the_motors_maximum_speed() {
        assert_eq!(run(0, 180, 0, 1), (49, 3_720_000));
    }

    #[test]
    fn d11_speed_has_priority_over_time() {
        assert_eq!(run(0, 95, 50, 100).0, 100);
    }

    #[test]
    fn d11_a_change_of_speed_is_effective_immediately() {
        let mut trajectory = Trajectory::holding(degrees(0));
        trajectory.move_to(degrees(100), 0);
        trajectory.advance(Instant::ZERO, 1);
        assert_eq!(trajectory.set_point().0, 19_000);
        trajectory.advance(Instant::ZERO, 100);
        assert_eq!(trajectory.set_point().0, 1_919_000);
    }

    #[test]
    fn d25_the_time_of_a_move_does_not_pass_while_it_waits() {
        let mut trajectory = Trajectory::holding(degrees(0));
        trajectory.move_to(degrees(100), 10);
        for _ in 0..50 {
            trajectory.advance(Instant::ZERO, 0);
        }
        for _ in 0..500 {
            trajectory.advance(Instant::ZERO, 0);
            trajectory.hold_back(degrees(50));
        }
        trajectory.advance(Instant::ZERO, 0);
        assert_eq!(trajectory.set_point(), degrees(51), "as fast as before");
    }

    #[test]
    fn a_new_target_during_a_move_causes_no_jump() {
        let mut trajectory = Trajectory::holding(degrees(0));
        trajectory.move_to(degrees(100), 0);
        trajectory.advance(Instant::ZERO, 100);
        trajectory.move_to(degrees(0), 0);
        trajectory.advance(Instant::ZERO, 50);
        assert_eq!(trajectory.set_point().0, 950_000);
    }
}
