//! Many worlds, on all processors, until the budget is used up or a rule is violated.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration as RealTime, Instant as RealInstant};

use protocol_core::time::Duration;

use crate::parser::{self, Line};
use crate::scenario::{Scenario, of_seed};
use crate::tally::Tally;
use crate::world::{Failure, World};

/// The length of a world.
const HOUR: Duration = Duration::from_millis(3_600_000);
/// Between two looks at how far it is.
const LOOK: RealTime = RealTime::from_millis(500);

/// How much is tried.
#[derive(Clone, Copy, Debug)]
pub enum Budget {
    /// So much virtual time.
    Virtual(Duration),
    /// So much real time.
    Real(RealTime),
}

/// What is tried.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// The seed of the first world; the others follow.
    pub seed: u64,
    /// How much.
    pub budget: Budget,
    /// Only this scenario; `None`: they take turns.
    pub scenario: Option<&'static Scenario>,
    /// Good frames for each kind of disturbance of the parser's line.
    pub frames: usize,
}

/// What came of it.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Worlds and their counts, by scenario.
    pub worlds: BTreeMap<&'static str, (u64, Tally)>,
    /// The violation with the lowest seed.
    pub failure: Option<Box<Failure>>,
    /// The parser's lines.
    pub lines: Vec<Line>,
    /// How long the worlds took.
    pub worlds_took: RealTime,
}

impl Outcome {
    /// All worlds together.
    #[must_use]
    pub fn total(&self) -> (u64, Tally) {
        self.worlds.values().fold((0, Tally::default()), |(worlds, mut sum), (more, tally)| {
            sum += *tally;
            (worlds + more, sum)
        })
    }

    /// Was nothing violated?
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.failure.is_none() && self.lines.iter().all(Line::is_good)
    }
}

/// What a worker has to say.
enum News {
    World(&'static Scenario, Tally),
    Failure(Box<Failure>),
}

/// What is left to do.
struct Left {
    seed: u64,
    time: Duration,
    is_over: bool,
}

/// Tries the plan, and says now and then how far it is.
pub fn run(plan: &Plan, mut progress: impl FnMut(&Outcome, RealTime)) -> Outcome {
    let mut outcome = Outcome::default();
    let start = RealInstant::now();
    let time = match plan.budget {
        Budget::Virtual(time) => time,
        Budget::Real(_) => Duration::from_micros(u64::MAX),
    };
    let left = Mutex::new(Left { seed: plan.seed, time, is_over: false });
    thread::scope(|scope| {
        let (sender, receiver) = channel();
        for _ in 0..workers() {
            let sender = sender.clone();
            scope.spawn(|| work(plan, &left, start, sender));
        }
        drop(sender);
        collect(&mut outcome, &receiver, &left, |outcome| progress(outcome, start.elapsed()));
    });
    outcome.worlds_took = start.elapsed();
    if outcome.failure.is_none() && plan.frames > 0 {
        outcome.lines = lines(plan);
    }
    outcome
}

fn workers() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// World after world.
fn work(plan: &Plan, left: &Mutex<Left>, start: RealInstant, news: Sender<News>) {
    while let Some((seed, time)) = next_world(plan, left, start) {
        let scenario = plan.scenario.unwrap_or_else(|| of_seed(seed));
        let end = match World::new(seed, scenario).run(time) {
            Ok(tally) => News::World(scenario, tally),
            Err(failure) => News::Failure(failure),
        };
        // Nobody listens any more: then nobody wants more worlds.
        if news.send(end).is_err() {
            return;
        }
    }
}

fn next_world(plan: &Plan, left: &Mutex<Left>, start: RealInstant) -> Option<(u64, Duration)> {
    let mut left = left.lock().ok()?;
    let is_late = matches!(plan.budget, Budget::Real(limit) if start.elapsed() >= limit);
    if left.is_over || is_late || left.time == Duration::ZERO {
        return None;
    }
    let (seed, time) = (left.seed, left.time.min(HOUR));
    left.seed = seed.wrapping_add(1);
    left.time = Duration::from_micros(left.time.as_micros() - time.as_micros());
    Some((seed, time))
}

fn collect(
    outcome: &mut Outcome,
    news: &Receiver<News>,
    left: &Mutex<Left>,
    mut progress: impl FnMut(&Outcome),
) {
    loop {
        match news.recv_timeout(LOOK) {
            Ok(News::World(scenario, tally)) => {
                let (worlds, sum) = outcome.worlds.entry(scenario.name).or_default();
                *worlds += 1;
                *sum += tally;
            }
            Ok(News::Failure(failure)) => {
                left.lock().into_iter().for_each(|mut left| left.is_over = true);
                let is_first = outcome.failure.as_ref().is_none_or(|other| failure.seed < other.seed);
                if is_first {
                    outcome.failure = Some(failure);
                }
            }
            Err(RecvTimeoutError::Timeout) => progress(outcome),
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// The parser's lines, on all processors.
fn lines(plan: &Plan) -> Vec<Line> {
    let next = Mutex::new(0..parser::KINDS);
    let work = || {
        let mut done = Vec::new();
        while let Some(kind) = next.lock().ok().and_then(|mut next| next.next()) {
            done.extend(parser::run(kind, plan.seed, plan.frames).map(|line| (kind, line)));
        }
        done
    };
    let mut done: Vec<_> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers()).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap_or_default()).collect()
    });
    done.sort_by_key(|(kind, _)| *kind);
    done.into_iter().map(|(_, line)| line).collect()
}
