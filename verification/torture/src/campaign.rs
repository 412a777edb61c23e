//! Runs a campaign on all processors: worlds until the time is used up or a rule is violated. If no world fails, trials of free
//! motion and of the parser follow.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration as RealTime, Instant as RealInstant};

use protocol_core::time::Duration;

use crate::free_motion::{self, FreeMotionTrial};
use crate::parser_trial::{self, ParserTrial};
use crate::scenario::{Scenario, of_seed};
use crate::world::{FailedWorld, TortureWorld};
use crate::world_counts::WorldCounts;

/// The virtual time of a world: an hour. The last world of a virtual budget may be shorter.
const WORLD_TIME: Duration = Duration::from_millis(3_600_000);
/// Progress is reported whenever no world has ended for this long.
const PROGRESS_PERIOD: RealTime = RealTime::from_millis(500);

/// How long the worlds run: in virtual or in real time.
#[derive(Clone, Copy, Debug)]
pub enum TimeBudget {
    /// The sum of the virtual times of all worlds.
    Virtual(Duration),
    /// The real time within which worlds begin. Each of them then runs for its whole virtual time.
    Real(RealTime),
}

/// The worlds and trials to run, as the command line selects them.
#[derive(Clone, Copy, Debug)]
pub struct CampaignPlan {
    /// The seed of the first world. The next world has the next seed.
    pub seed: u64,
    /// How long worlds run. The trials of free motion and of the parser come afterwards.
    pub budget: TimeBudget,
    /// The scenario of all worlds; `None` if each seed selects its own.
    pub scenario: Option<&'static Scenario>,
    /// The number of good frames for each kind of disturbance in the trials of the parser; 0 skips these trials.
    pub frames: usize,
    /// The number of free motions, each carried out with and without protection (D27).
    pub motions: u64,
}

/// What a campaign has counted, and the world that failed.
#[derive(Debug, Default)]
pub struct CampaignResult {
    /// The number of completed worlds and the sum of their counts, by name of the scenario.
    pub worlds: BTreeMap<&'static str, (u64, WorldCounts)>,
    /// The failed world with the lowest seed; `None` if no world failed.
    pub failure: Option<Box<FailedWorld>>,
    /// The trials of the parser; empty if a world failed, or if the plan skips them.
    pub parser_trials: Vec<ParserTrial>,
    /// The sum of all trials of free motion; zero if a world failed.
    pub free_motion: FreeMotionTrial,
    /// The real time that the worlds took, without the trials after them.
    pub elapsed: RealTime,
}

impl CampaignResult {
    /// The number of completed worlds and the sum of their counts, over all scenarios.
    #[must_use]
    pub fn total(&self) -> (u64, WorldCounts) {
        self.worlds.values().fold((0, WorldCounts::default()), |(worlds, mut sum), (more, counts)| {
            sum += *counts;
            (worlds + more, sum)
        })
    }

    /// True if no rule was violated.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.failure.is_none()
            && self.free_motion.different.is_empty()
            && self.parser_trials.iter().all(ParserTrial::passed)
    }
}

/// A message of a worker: the result of a world.
enum WorkerMessage {
    Completed(&'static Scenario, WorldCounts),
    Failed(Box<FailedWorld>),
}

/// The worlds that no worker has started.
struct RemainingWork {
    seed: u64,
    time: Duration,
    is_stopped: bool,
}

/// Runs the plan. While worlds run, calls `progress` from time to time with the result so far and the elapsed real time.
pub fn run(plan: &CampaignPlan, mut progress: impl FnMut(&CampaignResult, RealTime)) -> CampaignResult {
    let mut result = CampaignResult::default();
    let start = RealInstant::now();
    let time = match plan.budget {
        TimeBudget::Virtual(time) => time,
        TimeBudget::Real(_) => Duration::from_micros(u64::MAX),
    };
    let remaining = Mutex::new(RemainingWork { seed: plan.seed, time, is_stopped: false });
    thread::scope(|scope| {
        let (sender, receiver) = channel();
        for _ in 0..workers() {
            let sender = sender.clone();
            scope.spawn(|| work(plan, &remaining, start, sender));
        }
        drop(sender);
        collect(&mut result, &receiver, &remaining, |result| progress(result, start.elapsed()));
    });
    result.elapsed = start.elapsed();
    if result.failure.is_none() {
        let motions = plan.seed..plan.seed.saturating_add(plan.motions);
        on_all_processors(motions, free_motion::run)
            .into_iter()
            .for_each(|trial| result.free_motion.add(trial));
        let kinds = 0..if plan.frames > 0 { parser_trial::DISTURBANCES } else { 0 };
        let trials = on_all_processors(kinds, |kind| parser_trial::run(kind, plan.seed, plan.frames));
        result.parser_trials = trials.into_iter().flatten().collect();
    }
    result
}

fn workers() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Runs worlds until none remain.
fn work(
    plan: &CampaignPlan,
    remaining: &Mutex<RemainingWork>,
    start: RealInstant,
    messages: Sender<WorkerMessage>,
) {
    while let Some((seed, time)) = next_world(plan, remaining, start) {
        let scenario = plan.scenario.unwrap_or_else(|| of_seed(seed));
        let message = match TortureWorld::new(seed, scenario).run(time) {
            Ok(counts) => WorkerMessage::Completed(scenario, counts),
            Err(failure) => WorkerMessage::Failed(failure),
        };
        // The receiver is gone, so the campaign is over.
        if messages.send(message).is_err() {
            return;
        }
    }
}

fn next_world(
    plan: &CampaignPlan,
    remaining: &Mutex<RemainingWork>,
    start: RealInstant,
) -> Option<(u64, Duration)> {
    let mut remaining = remaining.lock().ok()?;
    let is_late = matches!(plan.budget, TimeBudget::Real(limit) if start.elapsed() >= limit);
    if remaining.is_stopped || is_late || remaining.time == Duration::ZERO {
        return None;
    }
    let (seed, time) = (remaining.seed, remaining.time.min(WORLD_TIME));
    remaining.seed = seed.wrapping_add(1);
    remaining.time = Duration::from_micros(remaining.time.as_micros() - time.as_micros());
    Some((seed, time))
}

fn collect(
    result: &mut CampaignResult,
    messages: &Receiver<WorkerMessage>,
    remaining: &Mutex<RemainingWork>,
    mut progress: impl FnMut(&CampaignResult),
) {
    loop {
        match messages.recv_timeout(PROGRESS_PERIOD) {
            Ok(WorkerMessage::Completed(scenario, counts)) => {
                let (worlds, sum) = result.worlds.entry(scenario.name).or_default();
                *worlds += 1;
                *sum += counts;
            }
            Ok(WorkerMessage::Failed(failure)) => {
                remaining.lock().into_iter().for_each(|mut remaining| remaining.is_stopped = true);
                let is_first = result.failure.as_ref().is_none_or(|other| failure.seed < other.seed);
                if is_first {
                    result.failure = Some(failure);
                }
            }
            Err(RecvTimeoutError::Timeout) => progress(result),
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Runs trials on all processors. The results have the order of the trials.
fn on_all_processors<N: Copy + Ord + Send, T: Send>(trials: Range<N>, run: impl Fn(N) -> T + Sync) -> Vec<T>
where
    Range<N>: Iterator<Item = N>,
{
    let next = Mutex::new(trials);
    let work = || {
        let mut done = Vec::new();
        while let Some(trial) = next.lock().ok().and_then(|mut next| next.next()) {
            done.push((trial, run(trial)));
        }
        done
    };
    let mut done: Vec<_> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers()).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap_or_default()).collect()
    });
    done.sort_by_key(|(trial, _)| *trial);
    done.into_iter().map(|(_, result)| result).collect()
}
