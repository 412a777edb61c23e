//! One run of a movement: the steps that are due, its end, and the counts of late points. Has no arm, input, output or clock.
//!
//! ```text
//!   Approach, PointPath or steps ──▶ MovementRun ◀── time
//!                                        │
//!                                        └──▶ RunStep: points and frames to send, or until when to wait
//! ```
//!
//! The blocking [`Player`](crate::moves::Player) and the page in a browser are shells round it. All times of the clock count
//! from the same instant.

use std::time::Duration;

use protocol_core::registers::map::VACUUM_PUMP;

use crate::approach::Approach;
use crate::fine::fine_frames;
use crate::fine_state::FineTargets;
use crate::playback::Step;
use crate::point_path::PointPath;
use crate::stream::{PaceCounts, StreamPace};

/// The measurements go on for this time after the end of a path or of steps, because servos lag.
const TAIL: Duration = Duration::from_millis(300);
/// After a longer pause of the program, the movement goes on where it paused: the arm has stopped there, and would leap if
/// the next point were a later one.
const LONGEST_PASSED_OVER: Duration = Duration::from_millis(200);
/// After a longer pause the movement is over. A person may rely on an arm that has stopped.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// An action that is due, or the time until which there is none: the results of [`MovementRun::poll`].
#[derive(Clone, Debug, PartialEq)]
pub enum RunStep {
    /// Send this point of a stream.
    Point(FineTargets),
    /// Switch the pump: true sucks.
    Vacuum(bool),
    /// Send this step in whole degrees.
    Step(Step),
    /// Nothing is due before this time.
    Wait(Duration),
    /// The run is over, a short time after its last point or step.
    Over,
    /// The run is over before its end: the program paused for this time, and the arm has stopped.
    Paused(Duration),
}

impl RunStep {
    /// The frames to write, each an address and its values.
    #[must_use]
    pub fn frames(&self) -> Vec<(u8, Vec<u8>)> {
        match self {
            Self::Point(point) => fine_frames(point),
            Self::Vacuum(is_on) => vec![(VACUUM_PUMP.address, vec![u8::from(*is_on)])],
            Self::Step(step) => vec![(VACUUM_PUMP.address, step.registers())],
            Self::Wait(_) | Self::Over | Self::Paused(_) => Vec::new(),
        }
    }
}

#[derive(Clone, Debug)]
enum Content {
    Way(Approach),
    Path(PointPath),
    Steps(Vec<Step>),
}

/// One run along a movement. [`Self::poll`] returns the steps that are due.
///
/// ```
/// use sevenbot::movement_run::{MovementRun, RunStep};
/// use sevenbot::{point_path::PointPath, recording::Recording};
/// use std::time::Duration;
///
/// # fn main() -> Result<(), sevenbot::recording::RecordingError> {
/// let text = "7bot-recording 1\n0 90 90 65 90 90 90 80 0\n1 120 90 65 90 90 90 80 0\n";
/// let path = PointPath::new(&Recording::parse(text)?, 1.0);
/// let period = Duration::from_millis(20);
/// let mut run = MovementRun::along(path, Some(false), Duration::ZERO, period);
/// assert!(matches!(run.poll(Duration::ZERO), RunStep::Point(_)));
/// assert_eq!(run.poll(Duration::ZERO), RunStep::Wait(period));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct MovementRun {
    content: Content,
    period: Duration,
    pace: StreamPace,
    /// The time along the movement of the point with number 0.
    base: Duration,
    /// The time along the movement of the last point or step that was sent.
    reached: Duration,
    /// The number of the next step in whole degrees.
    next_step: usize,
    /// Does the pump suck? `None` if unknown.
    vacuum: Option<bool>,
    /// The point to send next, after the pump was switched.
    point: Option<FineTargets>,
    /// After the last point or step: when the run is over.
    end: Option<Duration>,
}

impl MovementRun {
    /// Goes the way to a first point, with a point each `period`.
    #[must_use]
    pub fn approach(way: Approach, now: Duration, period: Duration) -> Self {
        Self::new(Content::Way(way), None, now, period)
    }

    /// Goes along a path, with a point each `period`. `vacuum`: does the pump suck now? `None` if unknown.
    #[must_use]
    pub fn along(path: PointPath, vacuum: Option<bool>, now: Duration, period: Duration) -> Self {
        Self::new(Content::Path(path), vacuum, now, period)
    }

    /// Sends steps in whole degrees, for an arm that takes no stream.
    #[must_use]
    pub fn in_steps(steps: Vec<Step>, now: Duration) -> Self {
        Self::new(Content::Steps(steps), None, now, Duration::ZERO)
    }

    fn new(content: Content, vacuum: Option<bool>, now: Duration, period: Duration) -> Self {
        let pace = StreamPace::new(now, period);
        let (base, reached) = (Duration::ZERO, Duration::ZERO);
        Self { content, period, pace, base, reached, next_step: 0, vacuum, point: None, end: None }
    }

    /// How many points or steps along the movement were reached, and how many there are.
    #[must_use]
    pub fn progress(&self) -> (u64, u64) {
        let points = |time: Duration| time.as_millis().div_ceil(self.period.as_millis().max(1));
        let [reached, all] = match &self.content {
            Content::Steps(steps) => [self.next_step, steps.len()].map(|count| u64::try_from(count).ok()),
            _ => [self.reached, self.duration()].map(|time| u64::try_from(points(time)).ok()),
        };
        (reached.unwrap_or(u64::MAX), all.unwrap_or(u64::MAX))
    }

    /// How well the points kept to their due times.
    #[must_use]
    pub const fn counts(&self) -> PaceCounts {
        self.pace.counts()
    }

    fn duration(&self) -> Duration {
        match &self.content {
            Content::Way(way) => way.duration(),
            Content::Path(path) => path.duration(),
            Content::Steps(steps) => steps.last().map_or(Duration::ZERO, |last| last.time),
        }
    }

    /// What is due at `now`. Do it and call again, until [`RunStep::Wait`] or an end.
    pub fn poll(&mut self, now: Duration) -> RunStep {
        if let Some(point) = self.point.take() {
            return RunStep::Point(point);
        }
        if let Some(end) = self.end {
            return if now >= end { RunStep::Over } else { RunStep::Wait(end) };
        }
        let due = self.due();
        let lateness = now.saturating_sub(due);
        if now < due {
            return RunStep::Wait(due);
        }
        if lateness > LONGEST_PAUSE {
            return RunStep::Paused(lateness);
        }
        if lateness > LONGEST_PASSED_OVER {
            // Go on with the point that was due when the pause began.
            self.base = self.along_at(due);
            self.pace.restart(now);
        }
        if let Content::Steps(steps) = &self.content {
            let step = steps.get(self.next_step).copied();
            return self.send_step(now, step);
        }
        let number = self.pace.take(now);
        self.send_point(now, self.base + self.period.saturating_mul(number))
    }

    /// The time along the movement at a time of the clock.
    fn along_at(&self, time: Duration) -> Duration {
        self.base + time.saturating_sub(self.pace.start())
    }

    /// When the next point or step is due.
    fn due(&self) -> Duration {
        match &self.content {
            Content::Steps(steps) => {
                let time = steps.get(self.next_step).map_or(Duration::ZERO, |step| step.time);
                self.pace.start() + time.saturating_sub(self.base)
            }
            _ => self.pace.due(),
        }
    }

    fn send_step(&mut self, now: Duration, step: Option<Step>) -> RunStep {
        let Some(step) = step else { return RunStep::Over };
        (self.reached, self.next_step) = (step.time, self.next_step + 1);
        if step.time >= self.duration() {
            self.end = Some(now + TAIL);
        }
        RunStep::Step(step)
    }

    fn send_point(&mut self, now: Duration, time: Duration) -> RunStep {
        self.reached = time.min(self.duration());
        let (point, vacuum) = match &mut self.content {
            Content::Path(path) => {
                let Some(moment) = path.at(time) else { return RunStep::Over };
                (moment.pose.map(Some), Some(moment.vacuum))
            }
            Content::Way(way) => (way.at(time), None),
            Content::Steps(_) => return RunStep::Over,
        };
        if time >= self.duration() {
            // A joint reaches a point at most two periods and a control cycle after its frame (D23).
            let rest = if vacuum.is_some() { 2 * self.period + TAIL } else { self.period };
            self.end = Some(now + rest);
        }
        match vacuum.filter(|_| vacuum != self.vacuum) {
            None => RunStep::Point(point),
            Some(is_on) => {
                (self.vacuum, self.point) = (vacuum, Some(point));
                RunStep::Vacuum(is_on)
            }
        }
    }
}

#[cfg(test)]
mod tests;
