//! The steps of `cargo xtask test`: which belong to a run, and how long each takes. Knows nothing of what a step does.

use std::time::{Duration, Instant};

use crate::run::Outcome;
use crate::times::Times;
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

/// How much is done. Each extent includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Extent {
    /// What a change is tried with.
    Quick,
    /// What has to pass before a change is kept.
    Whole,
    /// What has to pass before a release.
    Long,
}

/// A heading, what is done under it, and the least extent that includes it.
pub(crate) struct Step {
    heading: &'static str,
    extent: Extent,
    act: fn() -> Outcome,
}

/// A step of every run.
pub(crate) const fn quick(heading: &'static str, act: fn() -> Outcome) -> Step {
    Step { heading, extent: Extent::Quick, act }
}

/// A step of all runs but the quick one.
pub(crate) const fn whole(heading: &'static str, act: fn() -> Outcome) -> Step {
    Step { heading, extent: Extent::Whole, act }
}

/// A step of the long run only.
pub(crate) const fn long(heading: &'static str, act: fn() -> Outcome) -> Step {
    Step { heading, extent: Extent::Long, act }
}

/// Carries out the steps of this extent, until one fails. The table of times comes before the last step, whose output
/// is to be the last of the run.
pub(crate) fn carry_out(steps: &[Step], extent: Extent) -> Outcome {
    let steps: Vec<_> = steps.iter().filter(|step| step.extent <= extent).collect();
    let mut taken: Vec<(&str, Times)> = Vec::new();
    let start = Instant::now();
    for (number, step) in (1..).zip(&steps) {
        if number == steps.len() {
            println!("\n{}", table(&taken, start.elapsed()));
        }
        println!("\n=== {number}/{} {} (after {} s)", steps.len(), step.heading, start.elapsed().as_secs());
        let before = Times::now();
        let outcome = (step.act)();
        let times = Times::now() - before;
        if number != steps.len() {
            println!("--- {} took {times}", step.heading);
        }
        outcome.map_err(|why| format!("step {number}, {}: {why}", step.heading))?;
        taken.push((step.heading, times));
    }
    Ok(())
}

/// The last row of the table.
const ALL: &str = "all of these";

fn table(taken: &[(&str, Times)], all: Duration) -> TextTable {
    let mut table = TextTable::new([Left("step"), Right("seconds"), Right("processor")]);
    for (heading, times) in taken {
        let [passed, worked] = times.cells();
        table.add([*heading, &passed, &worked]);
    }
    table.add([ALL, &all.as_secs().to_string()]);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_a_row_for_each_step_and_the_sum() {
        let second = Times { passed: Duration::from_secs(1), worked: Some(Duration::from_millis(1_900)) };
        let unknown = Times { passed: Duration::from_secs(61), worked: None };
        let table = table(&[("format", second), ("lints, host", unknown)], Duration::from_secs(62));
        let table = table.to_string();
        let lines: Vec<_> = table.lines().collect();
        assert_eq!(
            lines,
            [
                "step          seconds  processor",
                "format              1        1.9",
                "lints, host        61          ?",
                "all of these       62",
            ]
        );
    }

    #[test]
    fn a_longer_run_includes_the_shorter_one_and_a_failure_ends_it() {
        const STEPS: &[Step] =
            &[quick("a", || Ok(())), whole("b", || Err("b failed".into())), quick("c", || Ok(()))];
        assert!(carry_out(STEPS, Extent::Quick).is_ok());
        for extent in [Extent::Whole, Extent::Long] {
            assert_eq!(
                carry_out(STEPS, extent).map_err(|why| why.to_string()),
                Err("step 2, b: b failed".to_owned())
            );
        }
    }
}
