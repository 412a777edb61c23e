//! The results of trials: their number and their failures.
//!
//! A program reports a trial as a line of three columns, separated by tabs.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::run::{TaskResult, root};
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

pub(crate) struct Trials {
    table: TextTable,
    has_failure: bool,
}

impl Default for Trials {
    fn default() -> Self {
        let columns = [Left("trial"), Right("number"), Left("failures")];
        Self { table: TextTable::new(columns), has_failure: false }
    }
}

impl Trials {
    /// Adds a row for a trial.
    pub(crate) fn add(&mut self, trial: &str, number: &str, failures: &str) {
        self.table.add([trial, number, failures]);
    }

    /// Adds a trial that failed or could not be completed.
    pub(crate) fn fail(&mut self, trial: &str, number: &str, failures: &str) {
        self.has_failure = true;
        self.add(trial, number, failures);
    }

    /// Runs a program in the root of the workspace, and adds the trials that it reports. Prints the rest of its output. If the
    /// program fails, this is a failed trial, and later trials still run.
    pub(crate) fn take(&mut self, words: &str, variables: &[(&str, &str)]) -> TaskResult {
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
            [trial, number, failures] => self.add(trial, number, failures),
            _ => println!("{line}"),
        }
    }

    /// Prints the table of trials. Fails if a trial failed.
    pub(crate) fn finish(&self, seed: u64) -> TaskResult {
        println!("\n{}\nseed {seed}", self.table);
        if self.has_failure { Err("a trial failed: see the table".into()) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_with_two_tabs_is_a_trial() {
        let mut trials = Trials::default();
        trials.add_line("worlds\t12\tnone");
        trials.add_line("not\ta row");
        trials.add("more", "3", "");
        let shown = trials.table.to_string();
        let lines: Vec<_> = shown.lines().collect();
        assert_eq!(lines, ["trial   number  failures", "worlds      12  none", "more         3",]);
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
