//! Statistics of a servo bus: questions, answers, goals and round-trip times.
//!
//! They are computed from the bytes of both directions. Time is an argument.

use std::fmt;

use motion_core::CYCLE;
use motion_core::servo_bus::frame::{BROADCAST, Decoder, Instruction, register};
use protocol_core::time::{Duration, Instant};

/// The resolution of round-trip times.
const GRAIN_US: u64 = 100;
/// Number of steps of the resolution. Round-trip times above 100 ms count as 100 ms.
const GRAINS: usize = 1_000;

/// Counts of a period, which began at `since`.
#[derive(Debug)]
pub struct BusStatistics {
    since: Instant,
    decoder: Decoder,
    /// The servo id and the time of the last question; `None` after its answer.
    asked: Option<(u8, Instant)>,
    questions: u64,
    goals: u64,
    /// Number of received bytes, including those outside answers.
    bytes: u64,
    answers: u64,
    round_trips: Vec<u32>,
}

/// The figures of a period. `host-sim --servos` logs them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Questions per control cycle of 10 ms.
    pub questions_per_cycle: f64,
    /// Frames with goals per second.
    pub goals_per_second: f64,
    /// The median time from writing a question to the port to reading its answer.
    pub median: Duration,
    /// The 99th percentile of this time.
    pub p99: Duration,
    /// Number of answers to questions. An echo of a question is none.
    pub answers: u64,
    /// Number of received bytes, including those outside answers.
    pub bytes: u64,
}

impl BusStatistics {
    /// Starts a period.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self {
            since: now,
            decoder: Decoder::new(),
            asked: None,
            questions: 0,
            goals: 0,
            bytes: 0,
            answers: 0,
            round_trips: vec![0; GRAINS],
        }
    }

    /// Counts the questions, and the frames with goals, in bytes that are written to the port. The bytes must be whole frames.
    pub fn sent(&mut self, now: Instant, bytes: &[u8]) {
        let mut decoder = Decoder::new();
        for piece in bytes.chunks(Decoder::CAPACITY / 2) {
            decoder.push(piece);
            while let Some(found) = decoder.pull() {
                let Ok(frame) = found else { continue };
                if frame.code == Instruction::Read as u8 {
                    self.questions += 1;
                    self.asked = Some((frame.id, now));
                } else if frame.id == BROADCAST && frame.params.first() == Some(&register::GOAL_POSITION) {
                    self.goals += 1;
                }
            }
        }
    }

    /// Counts bytes that were read from the port, and the answers in them with their round-trip times.
    pub fn received(&mut self, now: Instant, bytes: &[u8]) {
        self.bytes += bytes.len() as u64;
        for piece in bytes.chunks(Decoder::CAPACITY / 2) {
            self.decoder.push(piece);
            while let Some(found) = self.decoder.pull() {
                let Ok(frame) = found else { continue };
                // An echo of the question has two parameters, an answer has eight or more.
                if let Some((_, at)) = self.asked.filter(|&(id, _)| id == frame.id && frame.params.len() > 2)
                {
                    self.asked = None;
                    self.answers += 1;
                    let grains = usize::try_from((now - at).as_micros() / GRAIN_US).unwrap_or(GRAINS);
                    if let Some(count) = self.round_trips.get_mut(grains.min(GRAINS - 1)) {
                        *count += 1;
                    }
                }
            }
        }
    }

    /// Ends the period and starts another one.
    pub fn take(&mut self, now: Instant) -> Figures {
        let figures = self.figures(now);
        let asked = self.asked;
        *self = Self { asked, ..Self::new(now) };
        figures
    }

    #[allow(clippy::cast_precision_loss)] // Counts are far below 2^52.
    fn figures(&self, now: Instant) -> Figures {
        let micros = (now - self.since).as_micros().max(1) as f64;
        Figures {
            questions_per_cycle: self.questions as f64 * CYCLE.as_micros() as f64 / micros,
            goals_per_second: self.goals as f64 * 1e6 / micros,
            median: self.quantile(50),
            p99: self.quantile(99),
            answers: self.answers,
            bytes: self.bytes,
        }
    }

    fn quantile(&self, percent: u64) -> Duration {
        let wanted = (self.answers * percent).div_ceil(100);
        let mut seen = 0;
        let grains = self.round_trips.iter().take_while(|&&count| {
            seen += u64::from(count);
            seen < wanted
        });
        // The upper bound of the step.
        Duration::from_micros((grains.count() as u64 + 1) * GRAIN_US)
    }
}

impl fmt::Display for Figures {
    #[allow(clippy::cast_precision_loss)] // Round trips are milliseconds.
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        let millis = |time: Duration| time.as_micros() as f64 / 1e3;
        write!(
            text,
            "{:.1} questions per cycle of 10 ms, {:.0} goals/s",
            self.questions_per_cycle, self.goals_per_second
        )?;
        if self.answers == 0 {
            return write!(text, ", no answer");
        }
        write!(text, ", round trip p50 {:.1} ms, p99 {:.1} ms", millis(self.median), millis(self.p99))
    }
}

#[cfg(test)]
mod tests {
    use motion_core::servo_bus::frame::{ServoFrameBuffer, read, status, sync_write};

    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    #[test]
    fn questions_goals_and_round_trips_are_counted() {
        let mut statistics = BusStatistics::new(at(0));
        let (mut question, mut answer, mut goals) =
            (ServoFrameBuffer::new(), ServoFrameBuffer::new(), ServoFrameBuffer::new());
        read(&mut question, 2, register::PRESENT_POSITION, 8);
        status(&mut answer, 2, 0, &[0; 8]);
        sync_write(&mut goals, register::GOAL_POSITION, [(2, [0; 6])].into_iter());
        for round in 0..100 {
            let start = at(round * 10);
            statistics.sent(start, &[goals.as_slice(), question.as_slice()].concat());
            let takes = if round < 98 { 2 } else { 9 };
            // An echo, and the answer in two pieces.
            statistics.received(start, &question);
            statistics.received(start, &answer[..5]);
            statistics.received(start + Duration::from_millis(takes), &answer[5..]);
        }
        let figures = statistics.take(at(1_000));
        assert!(
            (figures.questions_per_cycle - 1.0).abs() < 1e-9
                && (figures.goals_per_second - 100.0).abs() < 1e-9
        );
        assert_eq!(
            (figures.answers, figures.median, figures.p99),
            (100, Duration::from_micros(2_100), Duration::from_micros(9_100))
        );
        assert_eq!(statistics.take(at(2_000)).answers, 0);
    }
}
