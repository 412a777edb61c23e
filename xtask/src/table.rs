//! A table of what was tried: rows of three columns, gathered from the programs that try.
//!
//! A program says a row as a line with a tab between its columns. Knows nothing of what is tried.

use std::fmt::{self, Display};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::run::{Outcome, root};

/// What was tried, how many, what went wrong.
type Row = [String; 3];

/// The rows so far.
#[derive(Default)]
pub(crate) struct Table {
    rows: Vec<Row>,
    has_failure: bool,
}

impl Table {
    /// Adds a row.
    pub(crate) fn add(&mut self, tried: &str, many: &str, wrong: &str) {
        self.rows.push([tried, many, wrong].map(str::to_owned));
    }

    /// Adds a row about something that failed, or could not be tried to its end.
    pub(crate) fn fail(&mut self, tried: &str, many: &str, wrong: &str) {
        self.has_failure = true;
        self.add(tried, many, wrong);
    }

    /// Runs a program at the root of the workspace and takes the rows it says; the rest of its output is
    /// shown. Its failure is a row, too: what comes after it is tried all the same.
    pub(crate) fn take(&mut self, words: &str, variables: &[(&str, &str)]) -> Outcome {
        let mut words_apart = words.split_whitespace();
        let mut program = Command::new(words_apart.next().unwrap_or_default());
        program.args(words_apart).envs(variables.iter().copied()).current_dir(root()).stdout(Stdio::piped());
        let mut child = program.spawn().map_err(|why| format!("cannot start `{words}`: {why}"))?;
        for line in child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines()) {
            self.hear(&line?);
        }
        if !child.wait()?.success() {
            self.fail(&format!("`{words}`"), "", "FAILED: see above");
        }
        Ok(())
    }

    fn hear(&mut self, line: &str) {
        let columns: Vec<_> = line.split('\t').collect();
        match *columns {
            [tried, many, wrong] => self.add(tried, many, wrong),
            _ => println!("{line}"),
        }
    }

    /// Prints the table.
    pub(crate) fn finish(&self, seed: u64) -> Outcome {
        println!("\n{self}\nseed {seed}");
        if self.has_failure { Err("something went wrong: it is in the table".into()) } else { Ok(()) }
    }
}

impl Display for Table {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heading = ["what was tried", "how many", "what went wrong"].map(str::to_owned);
        let rows = || std::iter::once(&heading).chain(&self.rows);
        let width = |text: &String| text.chars().count();
        let tried_width = rows().map(|[tried, ..]| width(tried)).max().unwrap_or(0);
        let many_width = rows().map(|[_, many, _]| width(many)).max().unwrap_or(0);
        for [tried, many, wrong] in rows() {
            writeln!(out, "{tried:<tried_width$}  {many:>many_width$}  {wrong}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_with_two_tabs_are_rows() {
        let mut table = Table::default();
        table.hear("worlds\t12\tnothing");
        table.hear("not\ta row");
        table.add("more", "3", "");
        assert_eq!(table.rows.len(), 2);
        let shown = table.to_string();
        let lines: Vec<_> = shown.lines().map(str::trim_end).collect();
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
    fn a_program_that_fails_is_a_row() {
        let mut table = Table::default();
        table.take("false", &[]).unwrap();
        assert!(table.has_failure && table.rows.len() == 1);
        assert!(table.take("no-such-program", &[]).is_err());
    }
}
