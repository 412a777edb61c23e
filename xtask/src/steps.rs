//! The steps of `cargo xtask test`: their scope, which of them run side by side, and their times.

use std::fs::File;
use std::io::{Read, Seek};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use std::{env, thread};

use crate::run::TaskResult;
use crate::times::{self, Times};
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

/// The scope of a run. Each scope includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum TestScope {
    /// For a change in progress.
    Quick,
    /// For every commit.
    Whole,
    /// For a release.
    Long,
}

/// A step with its heading, and the smallest scope that includes it.
pub(crate) struct TestStep {
    heading: &'static str,
    scope: TestScope,
    act: fn() -> TaskResult,
}

/// Steps that run one after the other.
pub(crate) type Lane = &'static [TestStep];

/// Lanes that run side by side. The next stage begins when all have ended.
pub(crate) type Stage = &'static [Lane];

/// A step of every run.
pub(crate) const fn quick(heading: &'static str, act: fn() -> TaskResult) -> TestStep {
    TestStep { heading, scope: TestScope::Quick, act }
}

/// A step of all runs except the quick one.
pub(crate) const fn whole(heading: &'static str, act: fn() -> TaskResult) -> TestStep {
    TestStep { heading, scope: TestScope::Whole, act }
}

/// A step of the long run only.
pub(crate) const fn long(heading: &'static str, act: fn() -> TaskResult) -> TestStep {
    TestStep { heading, scope: TestScope::Long, act }
}

/// Does the work of the step with this heading, in the process that [`execute`] started for it.
pub(crate) fn act_of(stages: &[Stage], heading: &str) -> TaskResult {
    let mut steps = stages.iter().copied().flatten().copied().flatten();
    let step = steps.find(|step| step.heading == heading).ok_or("there is no such step")?;
    times::adopt_orphans()?;
    let outcome = (step.act)();
    times::wait_for_orphans();
    outcome
}

/// Runs a step in a process of its own, so that its output can be kept apart and its processor time can be measured.
/// `output` is `None` for our standard output.
pub(crate) fn execute(step: &TestStep, output: Option<File>) -> (Times, TaskResult) {
    let start = Instant::now();
    let outcome = (|| {
        let mut command = Command::new(env::current_exe()?);
        command.args(["test", "--step", step.heading]).stdin(Stdio::null());
        if let Some(output) = output {
            command.stdout(output.try_clone()?).stderr(output);
        }
        let mut child = command.spawn()?;
        let processor = Times::processor_of(&child)?;
        let outcome = if child.wait()?.success() { Ok(()) } else { Err("it failed".into()) };
        TaskResult::Ok((processor, outcome))
    })();
    let elapsed = start.elapsed();
    match outcome {
        Ok((processor, outcome)) => (Times { elapsed, processor }, outcome),
        Err(why) => (Times { elapsed, processor: None }, Err(why)),
    }
}

/// Runs the steps of this scope until one fails. Prints the table of times before the last stage, so that the output of that
/// stage is at the end.
pub(crate) fn run(
    stages: &[Stage],
    scope: TestScope,
    execute: impl Fn(&TestStep, Option<File>) -> (Times, TaskResult) + Sync,
) -> TaskResult {
    let selected = |lane: &&'static [TestStep]| -> Vec<&'static TestStep> {
        lane.iter().filter(|step| step.scope <= scope).collect()
    };
    let run = StepRun {
        completed: Mutex::default(),
        has_failed: AtomicBool::new(false),
        start: Instant::now(),
        execute,
    };
    for (number, stage) in (1..).zip(stages) {
        let lanes: Vec<_> = stage.iter().map(selected).filter(|lane| !lane.is_empty()).collect();
        if number == stages.len() {
            println!("\n{}", run.table());
        }
        match lanes.as_slice() {
            [lane] => run.lane(lane, false)?,
            lanes => thread::scope(|scope| {
                let running: Vec<_> = lanes
                    .iter()
                    .map(|lane| scope.spawn(|| run.lane(lane, true).map_err(|why| why.to_string())))
                    .collect();
                // Wait for all lanes. If several lanes fail, the first of them in the list is reported.
                let outcomes: Vec<_> = running.into_iter().map(thread::ScopedJoinHandle::join).collect();
                outcomes
                    .into_iter()
                    .try_for_each(|outcome| outcome.unwrap_or(Err("a thread panicked".to_owned())))
            })?,
        }
    }
    Ok(())
}

struct StepRun<E> {
    completed: Mutex<Vec<(&'static str, Times)>>,
    has_failed: AtomicBool,
    start: Instant,
    execute: E,
}

impl<E: Fn(&TestStep, Option<File>) -> (Times, TaskResult)> StepRun<E> {
    /// Runs the steps of a lane, until a step of any lane fails.
    fn lane(&self, steps: &[&'static TestStep], is_beside_others: bool) -> TaskResult {
        for step in steps {
            if self.has_failed.load(Ordering::Relaxed) {
                break;
            }
            let outcome = if is_beside_others { self.beside_others(step) } else { self.alone(step) };
            if let Err(why) = outcome {
                self.has_failed.store(true, Ordering::Relaxed);
                return Err(format!("step \"{}\": {why}", step.heading).into());
            }
        }
        Ok(())
    }

    /// Runs a step whose output appears at once.
    fn alone(&self, step: &'static TestStep) -> TaskResult {
        println!("\n=== {} (after {} s)", step.heading, self.start.elapsed().as_secs());
        let (times, outcome) = (self.execute)(step, None);
        println!("--- {} took {times}", step.heading);
        self.complete(step, times);
        outcome
    }

    /// Runs a step whose output appears at its end, in one piece.
    fn beside_others(&self, step: &'static TestStep) -> TaskResult {
        let mut output = tempfile::tempfile()?;
        println!("\n... {} begins (after {} s)", step.heading, self.start.elapsed().as_secs());
        let (times, outcome) = (self.execute)(step, Some(output.try_clone()?));
        let mut bytes = Vec::new();
        output.rewind()?;
        output.read_to_end(&mut bytes)?;
        let text = String::from_utf8_lossy(&bytes);
        println!("\n=== {}\n{text}--- {} took {times}", step.heading, step.heading);
        self.complete(step, times);
        outcome
    }

    fn complete(&self, step: &'static TestStep, times: Times) {
        if let Ok(mut completed) = self.completed.lock() {
            completed.push((step.heading, times));
        }
    }

    fn table(&self) -> TextTable {
        let completed = self.completed.lock().map(|completed| completed.clone()).unwrap_or_default();
        let processor = completed.iter().map(|(_, times)| times.processor).sum();
        table(&completed, Times { elapsed: self.start.elapsed(), processor })
    }
}

/// The heading of the last row.
const TOTAL: &str = "total so far";

fn table(completed: &[(&str, Times)], all: Times) -> TextTable {
    let mut table = TextTable::new([Left("step"), Right("seconds"), Right("processor")]);
    for (heading, times) in completed.iter().copied().chain([(TOTAL, all)]) {
        let [passed, worked] = times.cells();
        table.add([heading, &passed, &worked]);
    }
    table
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_table_has_a_row_for_each_step_and_the_sum() {
        let second = Times { elapsed: Duration::from_secs(1), processor: Some(Duration::from_millis(1_900)) };
        let unknown = Times { elapsed: Duration::from_secs(61), processor: None };
        let all = Times { elapsed: Duration::from_secs(62), processor: None };
        let table = table(&[("format", second), ("lints, host", unknown)], all).to_string();
        let lines: Vec<_> = table.lines().collect();
        assert_eq!(
            lines,
            [
                "step          seconds  processor",
                "format              1        1.9",
                "lints, host        61          ?",
                "total so far       62          ?",
            ]
        );
    }

    const STAGES: &[Stage] = &[
        &[&[quick("a", || Ok(()))]],
        &[&[whole("b", || Err("b failed".into())), quick("c", || Ok(()))], &[quick("d", || Ok(()))]],
        &[&[quick("e", || Ok(()))]],
    ];

    fn outcome(scope: TestScope) -> (Result<(), String>, Vec<&'static str>) {
        let ran = Mutex::new(Vec::new());
        let outcome = run(STAGES, scope, |step, output| {
            ran.lock().unwrap().push(step.heading);
            if let Some(mut output) = output {
                writeln!(output, "output of {}", step.heading).unwrap();
            }
            (Times { elapsed: Duration::ZERO, processor: None }, (step.act)())
        });
        (outcome.map_err(|why| why.to_string()), ran.into_inner().unwrap())
    }

    #[test]
    fn a_longer_run_includes_the_shorter_one_and_a_failure_ends_it() {
        let (quick, mut ran) = outcome(TestScope::Quick);
        ran.sort_unstable();
        assert_eq!((quick, ran), (Ok(()), vec!["a", "c", "d", "e"]));
        for scope in [TestScope::Whole, TestScope::Long] {
            let (whole, ran) = outcome(scope);
            assert_eq!(whole, Err("step \"b\": b failed".to_owned()));
            assert!(!ran.contains(&"c") && !ran.contains(&"e"), "{ran:?}");
        }
    }

    #[test]
    fn a_step_is_found_by_its_heading() {
        assert!(act_of(STAGES, "d").is_ok());
        assert_eq!(act_of(STAGES, "b").unwrap_err().to_string(), "b failed");
        assert!(act_of(STAGES, "x").is_err());
    }
}
