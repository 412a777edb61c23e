//! The steps of `cargo xtask test`: their scope and their times.

use std::time::{Duration, Instant};

use crate::run::TaskResult;
use crate::times::Times;
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

/// Runs the steps of this scope until one fails. Prints the table of times before the last step, so that its output is at the
/// end.
pub(crate) fn run(steps: &[TestStep], scope: TestScope) -> TaskResult {
    let steps: Vec<_> = steps.iter().filter(|step| step.scope <= scope).collect();
    let mut completed: Vec<(&str, Times)> = Vec::new();
    let start = Instant::now();
    for (number, step) in (1..).zip(&steps) {
        if number == steps.len() {
            println!("\n{}", table(&completed, start.elapsed()));
        }
        println!("\n=== {number}/{} {} (after {} s)", steps.len(), step.heading, start.elapsed().as_secs());
        let before = Times::now();
        let outcome = (step.act)();
        let times = Times::now() - before;
        if number != steps.len() {
            println!("--- {} took {times}", step.heading);
        }
        outcome.map_err(|why| format!("step {number}, {}: {why}", step.heading))?;
        completed.push((step.heading, times));
    }
    Ok(())
}

/// The heading of the last row.
const TOTAL: &str = "total";

fn table(completed: &[(&str, Times)], all: Duration) -> TextTable {
    let mut table = TextTable::new([Left("step"), Right("seconds"), Right("processor")]);
    for (heading, times) in completed {
        let [passed, worked] = times.cells();
        table.add([*heading, &passed, &worked]);
    }
    table.add([TOTAL, &all.as_secs().to_string()]);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_a_row_for_each_step_and_the_sum() {
        let second = Times { elapsed: Duration::from_secs(1), processor: Some(Duration::from_millis(1_900)) };
        let unknown = Times { elapsed: Duration::from_secs(61), processor: None };
        let table = table(&[("format", second), ("lints, host", unknown)], Duration::from_secs(62));
        let table = table.to_string();
        let lines: Vec<_> = table.lines().collect();
        assert_eq!(
            lines,
            [
                "step         seconds  processor",
                "format             1        1.9",
                "lints, host       61          ?",
                "total             62",
            ]
        );
    }

    #[test]
    fn a_longer_run_includes_the_shorter_one_and_a_failure_ends_it() {
        const STEPS: &[TestStep] =
            &[quick("a", || Ok(())), whole("b", || Err("b failed".into())), quick("c", || Ok(()))];
        assert!(run(STEPS, TestScope::Quick).is_ok());
        for scope in [TestScope::Whole, TestScope::Long] {
            assert_eq!(
                run(STEPS, scope).map_err(|why| why.to_string()),
                Err("step 2, b: b failed".to_owned())
            );
        }
    }
}
