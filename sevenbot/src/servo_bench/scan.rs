//! Finds the servos on the bus, and their baud rates.
//!
//! ```text
//!   each rate ──▶ each id: a question with a short timeout ──▶ candidates ──▶ each: questions with the full timeout
//! ```
//!
//! The first pass takes up to 4.3 ms for an id at 1 Mbaud. A slow USB adapter delivers an answer after that, while another
//! id is asked. The late answer then makes its sender a candidate.

use std::ops::RangeInclusive;
use std::time::Duration;

use motion_core::servo_bus::frame::register;

use super::bus_master::BusMaster;
use super::error::ServoError;

/// Bytes of a question and its answer, and a pause of one byte after each byte.
const EXCHANGE_BYTES: u32 = 30;
/// Time that a servo may need in addition. Its return delay is at most 0.5 ms.
const RETURN_DELAY: Duration = Duration::from_millis(4);
/// After the first pass of a rate, wait this long for late answers.
const LATE_ANSWERS: Duration = Duration::from_millis(200);

/// Baud rates and ids to scan.
#[derive(Clone, Debug)]
pub struct ScanPlan {
    /// Baud rates in the order of the scan.
    pub rates: Vec<u32>,
    /// The ids to ask at each rate.
    pub ids: RangeInclusive<u8>,
    /// Timeout for each id in the first pass; `None`: what a servo needs at that rate.
    pub wait: Option<Duration>,
}

/// How far a scan has come, for the progress that [`scan`] reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanProgress {
    /// The rate of the last question, in bits per second.
    pub baud: u32,
    /// Questions of the first pass so far, over all rates.
    pub asked: usize,
    /// Ids at which something answered, at the rates that are done.
    pub found: usize,
}

/// An id at which something answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundServo {
    /// The rate at which it answered, in bits per second.
    pub baud: u32,
    /// The id on the servo bus, 0 to 253.
    pub id: u8,
    /// Whether the answers come from one servo, come from several, or are damaged.
    pub answers: AnswerQuality,
}

/// The kind of answers from one id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnswerQuality {
    /// One servo answers.
    Good,
    /// A question had several answers: several servos have this id.
    Several,
    /// All answers were damaged: several servos have this id, or the wiring is bad.
    Damaged,
}

impl AnswerQuality {
    /// `good`, `several servos` or `damaged answers`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Several => "several servos",
            Self::Damaged => "damaged answers",
        }
    }
}

/// What a scan found, and what it learned about the adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScanResult {
    /// In the order of the rates, then of the ids.
    pub found: Vec<FoundServo>,
    /// Rates that the adapter does not support.
    pub unknown_rates: Vec<u32>,
    /// Did the adapter echo the questions?
    pub has_echo: bool,
}

impl ScanPlan {
    /// A plan for all ids, 0 to 253, at one rate.
    #[must_use]
    pub fn all_ids(baud: u32, wait: Option<Duration>) -> Self {
        Self { rates: vec![baud], ids: 0..=super::MAX_ID, wait }
    }

    /// The number of questions in the first pass, if the adapter supports all rates.
    #[must_use]
    pub fn questions(&self) -> usize {
        self.rates.len() * self.ids.len()
    }

    fn wait_at(&self, baud: u32) -> Duration {
        self.wait.unwrap_or(Duration::from_secs(1) * (10 * EXCHANGE_BYTES) / baud.max(1) + RETURN_DELAY)
    }
}

/// Scans the bus. Calls `on_progress` after each question of the first pass, and after each rate that the adapter supports. The
/// bus keeps the last of these rates.
///
/// # Errors
/// The port failed.
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

/// The ids with any answer to a short question at this rate, in ascending order.
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
        // A late damaged answer may belong to the previous question.
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

/// Asks one id with the full timeout. `None` if nothing answers.
fn verify(bus: &mut BusMaster, id: u8, wait: Duration) -> Result<Option<AnswerQuality>, ServoError> {
    bus.take_damaged();
    let options = bus.options();
    for _ in 0..options.attempts.max(1) {
        // Several servos with one id measure different values, so their answers damage each other.
        if bus.try_read(id, register::PRESENT_POSITION, 8, options.reply_timeout)?.is_some() {
            let several = bus.extra_answers(id, wait)? > 0;
            return Ok(Some(if several { AnswerQuality::Several } else { AnswerQuality::Good }));
        }
    }
    Ok((bus.take_damaged() > 0).then_some(AnswerQuality::Damaged))
}
