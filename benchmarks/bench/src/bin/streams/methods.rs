//! Methods to make set-points from a stream of points: this project's, simpler ones, and methods of other projects,
//! implemented from their published rules.

use std::collections::VecDeque;

use motion_core::calibration::MicroDegrees;
use motion_core::trajectory::Trajectory;
use protocol_core::time::{Duration, Instant};

/// Seconds between two set-points.
pub(super) const CYCLE: f64 = 0.01;
/// The speed of a joint whose speed register is 0, in degrees per second (D10).
const FASTEST: f64 = 372.0;

/// Makes set-points from points. Times are in seconds, angles in degrees.
pub(super) trait SetPoints {
    /// The frame of a point arrived at `now`. `velocity` is the velocity of the motion, for methods that need it.
    fn point(&mut self, now: f64, angle: f64, velocity: f64);
    /// The set-point at the end of a control cycle.
    fn step(&mut self, now: f64) -> f64;
}

pub(super) struct Method {
    pub(super) name: &'static str,
    pub(super) new: fn(period: f64) -> Box<dyn SetPoints>,
}

pub(super) const OURS: Method = Method { name: "this firmware", new: |period| Box::new(Ours::new(period)) };

pub(super) const METHODS: [Method; 8] = [
    OURS,
    Method { name: "straight to the newest point", new: |_| Box::new(Newest::default()) },
    Method { name: "one period for each point", new: |period| Box::new(OnePeriod::new(period)) },
    Method { name: "queue of two points", new: |period| Box::new(Queue::new(period)) },
    Method { name: "predictor", new: |_| Box::new(Predictor::default()) },
    Method { name: "moteus, position and velocity", new: |_| Box::new(Moteus::default()) },
    Method { name: "CANopen, interpolated position", new: |period| Box::new(CanOpen::new(period)) },
    Method { name: "ros2_control, cubic spline", new: |period| Box::new(Spline::new(period)) },
];

/// The trajectory of motion-core.
struct Ours {
    trajectory: Trajectory,
    period: Duration,
}

impl Ours {
    fn new(period: f64) -> Self {
        Self {
            trajectory: Trajectory::holding(MicroDegrees(0)),
            period: Duration::from_micros(micros(period)),
        }
    }
}

impl SetPoints for Ours {
    fn point(&mut self, now: f64, angle: f64, _: f64) {
        let now = Instant::from_micros(micros(now));
        self.trajectory.stream_to(micro_degrees(angle), now, self.period);
    }

    fn step(&mut self, now: f64) -> f64 {
        self.trajectory.advance(Instant::from_micros(micros(now)), 0);
        f64::from(self.trajectory.set_point().0) / 1e6
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive, below 2^53")]
fn micros(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64
}

#[expect(clippy::cast_possible_truncation, reason = "below 2147 degrees")]
fn micro_degrees(degrees: f64) -> MicroDegrees {
    MicroDegrees((degrees * 1e6).round() as i32)
}

/// Goes to the newest point as fast as the joint can.
#[derive(Default)]
struct Newest {
    target: f64,
    at: f64,
}

impl SetPoints for Newest {
    fn point(&mut self, _: f64, angle: f64, _: f64) {
        self.target = angle;
    }

    fn step(&mut self, _: f64) -> f64 {
        self.at += (self.target - self.at).clamp(-FASTEST * CYCLE, FASTEST * CYCLE);
        self.at
    }
}

/// Goes to each point in one period, from the arrival of its frame on.
#[derive(Default)]
struct OnePeriod {
    period: f64,
    segment: Segment,
}

impl OnePeriod {
    fn new(period: f64) -> Self {
        Self { period, ..Self::default() }
    }
}

impl SetPoints for OnePeriod {
    fn point(&mut self, now: f64, angle: f64, _: f64) {
        self.segment = Segment { from: self.segment.at(now), start: now, to: angle, end: now + self.period };
    }

    fn step(&mut self, now: f64) -> f64 {
        self.segment.at(now)
    }
}

#[derive(Clone, Copy, Default)]
struct Segment {
    from: f64,
    start: f64,
    to: f64,
    end: f64,
}

impl Segment {
    fn at(&self, now: f64) -> f64 {
        if now >= self.end {
            return self.to;
        }
        self.from + (self.to - self.from) * ((now - self.start) / (self.end - self.start)).max(0.0)
    }
}

/// Starts when two points wait, and takes one each period of its own clock. Without a point it stops, and again waits for
/// two.
struct Queue {
    period: f64,
    waiting: VecDeque<f64>,
    segment: Segment,
    runs: bool,
}

impl Queue {
    fn new(period: f64) -> Self {
        Self { period, waiting: VecDeque::new(), segment: Segment::default(), runs: false }
    }

    fn next(&mut self, start: f64) {
        let from = self.segment.to;
        if let Some(to) = self.waiting.pop_front() {
            self.segment = Segment { from, start, to, end: start + self.period };
        } else {
            self.runs = false;
        }
    }
}

impl SetPoints for Queue {
    fn point(&mut self, now: f64, angle: f64, _: f64) {
        self.waiting.push_back(angle);
        if !self.runs && self.waiting.len() == 2 {
            self.runs = true;
            self.next(now);
        }
    }

    fn step(&mut self, now: f64) -> f64 {
        while self.runs && now >= self.segment.end {
            self.next(self.segment.end);
        }
        self.segment.at(now)
    }
}

/// Continues with the velocity between the last two points.
#[derive(Default)]
struct Predictor {
    last: Option<(f64, f64)>,
    velocity: f64,
}

impl SetPoints for Predictor {
    fn point(&mut self, now: f64, angle: f64, _: f64) {
        if let Some((then, before)) = self.last {
            self.velocity = (angle - before) / (now - then).max(1e-3);
        }
        self.last = Some((now, angle));
    }

    fn step(&mut self, now: f64) -> f64 {
        self.last.map_or(0.0, |(then, angle)| angle + self.velocity * (now - then))
    }
}

/// moteus: each command sets the control position and velocity; the position then integrates the velocity.
#[derive(Default)]
struct Moteus {
    command: Option<(f64, f64, f64)>,
}

impl SetPoints for Moteus {
    fn point(&mut self, now: f64, angle: f64, velocity: f64) {
        self.command = Some((now, angle, velocity));
    }

    fn step(&mut self, now: f64) -> f64 {
        self.command.map_or(0.0, |(then, angle, velocity)| angle + velocity * (now - then))
    }
}

/// CANopen (CiA 402), interpolated position mode without a common clock: at each tick of the drive the newest point
/// becomes the end of the next interval.
struct CanOpen {
    period: f64,
    newest: f64,
    segment: Segment,
}

impl CanOpen {
    fn new(period: f64) -> Self {
        Self { period, newest: 0.0, segment: Segment::default() }
    }
}

impl SetPoints for CanOpen {
    fn point(&mut self, _: f64, angle: f64, _: f64) {
        self.newest = angle;
    }

    fn step(&mut self, now: f64) -> f64 {
        while now >= self.segment.end {
            let (from, start) = (self.segment.to, self.segment.end);
            self.segment = Segment { from, start, to: self.newest, end: start + self.period };
        }
        self.segment.at(now)
    }
}

/// The joint trajectory controller of ros2_control: a cubic spline from the present set-point and velocity to the point
/// with its velocity, one period after the message. It then holds.
#[derive(Default)]
struct Spline {
    period: f64,
    start: f64,
    from: (f64, f64),
    to: (f64, f64),
}

impl Spline {
    fn new(period: f64) -> Self {
        Self { period, ..Self::default() }
    }

    /// Position and velocity.
    fn at(&self, now: f64) -> (f64, f64) {
        let t = (now - self.start) / self.period;
        if t >= 1.0 {
            return (self.to.0, 0.0);
        }
        let ((p0, v0), (p1, v1)) = (self.from, self.to);
        let (m0, m1) = (v0 * self.period, v1 * self.period);
        let (a, b) = (2.0 * (p0 - p1) + m0 + m1, 3.0 * (p1 - p0) - 2.0 * m0 - m1);
        let position = ((a * t + b) * t + m0) * t + p0;
        (position, ((3.0 * a * t + 2.0 * b) * t + m0) / self.period)
    }
}

impl SetPoints for Spline {
    fn point(&mut self, now: f64, angle: f64, velocity: f64) {
        (self.from, self.start, self.to) = (self.at(now), now, (angle, velocity));
    }

    fn step(&mut self, now: f64) -> f64 {
        self.at(now).0
    }
}
