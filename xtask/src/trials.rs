//! The results of trials: what was tried, how often, and what went wrong.
//!
//! A program reports a trial as a line of three columns with a tab between them. Knows nothing of what is tried.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::run::{Outcome, root};
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

/// The trials so far.
pub(crate) struct Trials {
    table: TextTable,
    has_failure: bool,
}

impl Default for Trials {
    fn default() -> Self {
        let columns = [Left("what was tried"), Right("how many"), Left("what went wrong")];
        Self { table: TextTable::new(columns), has_failure: false }
    }
}

impl Trials {
    /// Adds a trial.
    pub(crate) fn add(&mut self, tried: &str, many: &str, wrong: &str) {
        self.table.add([tried, many, wrong]);
    }

    /// Adds a trial that failed or could not be completed.
    pub(crate) fn fail(&mut self, tried: &str, many: &str, wrong: &str) {
        self.has_failure = true;
        self.add(tried, many, wrong);
    }

    /// Runs a program at the root of the workspace and adds the trials it reports. Prints the rest of its output.
    /// A program that fails is a failed trial; later trials still run.
    pub(crate) fn take(&mut self, words: &str, variables: &[(&str, &str)]) -> Outcome {
        let mut words_apart = words.split_whitespace();
        let mut program = Command::new(words_apart.next().unwrap_or_default());
        program.args(words_apart).envs(variables.iter().copied()).current_dir(root()).stdout(Stdio::piped());
        let mut child = program.spawn().map_err(|why| format!("cannot start `{words}`: {why}"))?;
        for line in child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines()) {
            self.add_line(&line?);
        }
        if !child.wait()?.success() {
            self.fail(&format!("`{words}`"), "", "FAILED: see above");
        }
        Ok(())
    }

    fn add_line(&mut self, line: &str) {
        let columns: Vec<_> = line.split('\t').collect();
        match *columns {
            [tried, many, wrong] => self.add(tried, many, wrong),
            _ => println!("{line}"),
        }
    }

    /// Prints the trials, and fails if one failed.
    pub(crate) fn finish(&self, seed: u64) -> Outcome {
        println!("\n{}\nseed {seed}", self.table);
        if self.has_failure { Err("something went wrong: it is in the table".into()) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_with_two_tabs_is_a_trial() {
        let mut trials = Trials::default();
        trials.add_line("worlds\t12\tnothing");
        trials.add_line("not\ta row");
        trials.add("more", "3", "");
        let shown = trials.table.to_string();
        let lines: Vec<_> = shown.lines().collect();
        assert_eq!(
            lines,
            [
                "what was tried  how many  what went wrong",
                "worlds                12  nothing",
                "more                   3",
            ]
        );
    }

    #[test]
    fn a_program_that_fails_is_a_failed_trial() {
        let mut trials = Trials::default();
        trials.take("false", &[]).unwrap();
        assert!(trials.has_failure);
        assert!(trials.table.to_string().contains("`false`"));
        assert!(trials.take("no-such-program", &[]).is_err());
    }
}
