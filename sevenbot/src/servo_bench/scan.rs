//! Which servos are on the bus, at which baud rates.
//!
//! ```text
//!   each rate ──▶ each id: a question with a short wait ──▶ candidates ──▶ each of those: patient questions
//! ```
//!
//! The short wait is over before a slow USB adapter has handed over the answer. The answer then comes while another id
//! is asked, and makes its sender a candidate. So the first pass takes 5 ms for an id at 1 Mbaud, not the latency of
//! the adapter.

use std::ops::RangeInclusive;
use std::time::Duration;

use motion_core::servo_bus::frame::register;

use super::bus_master::BusMaster;
use super::error::ServoError;

/// Bytes of the question and its answer, and as many again for a byte time each between them.
const EXCHANGE_BYTES: u32 = 30;
/// What a servo may take besides: its return delay is 0.5 ms at most.
const RETURN_DELAY: Duration = Duration::from_millis(4);
/// How long to listen for late answers at the end of each rate.
const LATE_ANSWERS: Duration = Duration::from_millis(200);

/// What to look for.
#[derive(Clone, Debug)]
pub struct ScanPlan {
    /// Baud rates, in the order they are tried.
    pub rates: Vec<u32>,
    /// Ids.
    pub ids: RangeInclusive<u8>,
    /// How long to wait for an id in the first pass; `None`: as long as a servo needs at that rate.
    pub wait: Option<Duration>,
}

/// How far a scan is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanProgress {
    /// The rate that is being tried.
    pub baud: u32,
    /// How many questions of the first pass are done, over all rates.
    pub asked: usize,
    /// How many servos were found.
    pub found: usize,
}

/// An id that something answers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundServo {
    /// The baud rate.
    pub baud: u32,
    /// The id.
    pub id: u8,
    /// What the answers were like.
    pub answers: AnswerQuality,
}

/// What the answers of an id were like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnswerQuality {
    /// One servo answers.
    Good,
    /// Several answers came to one question: several servos have this id.
    Several,
    /// Every answer was damaged: several servos with this id, or a bad wire.
    Damaged,
}

/// What a scan brought.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScanResult {
    /// By rate as planned, then by id.
    pub found: Vec<FoundServo>,
    /// Rates that the adapter does not know.
    pub unknown_rates: Vec<u32>,
    /// Was an echo of the questions received?
    pub has_echo: bool,
}

impl ScanPlan {
    /// How many questions the first pass takes.
    #[must_use]
    pub fn questions(&self) -> usize {
        self.rates.len() * self.ids.len()
    }

    fn wait_at(&self, baud: u32) -> Duration {
        self.wait.unwrap_or(Duration::from_secs(1) * (10 * EXCHANGE_BYTES) / baud.max(1) + RETURN_DELAY)
    }
}

/// Looks for servos. `on_progress` is told how far it is.
///
/// # Errors
/// The port is gone.
pub fn scan(
    bus: &mut BusMaster,
    plan: &ScanPlan,
    mut on_progress: impl FnMut(ScanProgress),
) -> Result<ScanResult, ServoError> {
    let (mut found, mut unknown_rates, mut asked) = (Vec::new(), Vec::new(), 0);
    for &baud in &plan.rates {
        match bus.set_baud(baud) {
            Ok(()) => {}
            Err(ServoError::NoSuchRate { .. }) => {
                unknown_rates.push(baud);
                continue;
            }
            Err(error) => return Err(error),
        }
        let wait = plan.wait_at(baud);
        let before = found.len();
        let candidates = candidates(bus, plan, wait, |in_rate| {
            on_progress(ScanProgress { baud, asked: asked + in_rate, found: before });
        })?;
        for id in candidates {
            found.extend(verify(bus, id, wait)?.map(|answers| FoundServo { baud, id, answers }));
        }
        asked += plan.ids.len();
        on_progress(ScanProgress { baud, asked, found: found.len() });
    }
    Ok(ScanResult { found, unknown_rates, has_echo: bus.has_echo() })
}

/// The ids of this rate that something came from in answer to a short question, in ascending order.
fn candidates(
    bus: &mut BusMaster,
    plan: &ScanPlan,
    wait: Duration,
    mut on_progress: impl FnMut(usize),
) -> Result<Vec<u8>, ServoError> {
    let mut candidates = Vec::new();
    let (mut damaged_before, mut done) = (None, 0);
    bus.take_damaged();
    for id in plan.ids.clone() {
        let is_answered = bus.try_read(id, register::ID, 1, wait)?.is_some();
        let is_damaged = bus.take_damaged() > 0;
        if is_answered || is_damaged {
            candidates.push(id);
        }
        // A damaged answer that comes late may be the one to the question before.
        candidates.extend(damaged_before.filter(|_| is_damaged));
        damaged_before = Some(id);
        done += 1;
        on_progress(done);
    }
    bus.wait_for_silence(LATE_ANSWERS)?;
    if bus.take_damaged() > 0 {
        candidates.extend(damaged_before);
    }
    candidates.extend(bus.take_late().into_iter().filter(|id| plan.ids.contains(id)));
    candidates.sort_unstable();
    candidates.dedup();
    Ok(candidates)
}

/// Asks one id patiently. `None`: nothing answers to it.
fn verify(bus: &mut BusMaster, id: u8, wait: Duration) -> Result<Option<AnswerQuality>, ServoError> {
    bus.take_damaged();
    let options = bus.options();
    for _ in 0..options.attempts.max(1) {
        // Answers of two servos with one id differ in what they measure, and damage each other.
        if bus.try_read(id, register::PRESENT_POSITION, 8, options.reply_timeout)?.is_some() {
            let several = bus.extra_answers(id, wait)? > 0;
            return Ok(Some(if several { AnswerQuality::Several } else { AnswerQuality::Good }));
        }
    }
    Ok((bus.take_damaged() > 0).then_some(AnswerQuality::Damaged))
}
