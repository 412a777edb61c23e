//! Compares figures with their committed values and limits. Lower figures are better.
//!
//! ```text
//!   xtask/budgets/size.txt:    name | committed | at most
//! ```

use std::fs;
use std::path::PathBuf;

use crate::run::{TaskResult, root};
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

/// The accepted increase over the committed value, in percent.
const TOLERANCE: u64 = 5;
/// The committed value of a figure that varies from run to run.
const VARIES: &str = "varies";
/// The first lines of a file of budgets that `accept` writes.
const INTRODUCTION: &str = "\
# name | committed | at most
# Less is better. `cargo xtask test` fails where a figure is more than 5 % above the one committed, or above the most
# that it may be; `cargo xtask size --accept` and `cargo xtask count --accept` commit what they measure. A figure that
# varies from run to run has a limit only.
";

/// A measured or counted value.
pub(crate) struct Figure {
    name: String,
    value: u64,
}

impl Figure {
    pub(crate) fn new(name: impl Into<String>, value: u64) -> Self {
        Self { name: name.into(), value }
    }
}

/// A line of a file of budgets.
struct Budget {
    name: String,
    /// `None`: the figure varies from run to run.
    committed: Option<u64>,
    max: Option<u64>,
}

impl Budget {
    fn parse(line: &str) -> Option<Self> {
        let mut cells = line.split('|').map(str::trim);
        let (name, committed, max) = (cells.next()?, cells.next()?, cells.next()?);
        let max = if max == "-" { None } else { Some(max.parse().ok()?) };
        let committed = if committed == VARIES { None } else { Some(committed.parse().ok()?) };
        // A line with neither a committed value nor a limit is an error.
        committed.or(max)?;
        Some(Self { name: name.to_owned(), committed, max })
    }

    fn committed_text(&self) -> String {
        self.committed.map_or_else(|| VARIES.to_owned(), |committed| committed.to_string())
    }

    fn violation(&self, value: u64) -> Option<String> {
        let is_increase = |committed: &u64| value > committed + committed * TOLERANCE / 100;
        match (self.max, self.committed.filter(is_increase)) {
            (Some(max), _) if value > max => Some(format!("the limit is {max}")),
            (_, Some(committed)) => Some(format!("was {committed}: the increase is above {TOLERANCE} %")),
            _ => None,
        }
    }
}

/// Prints the figures and compares them with `xtask/budgets/<file>.txt`. With `accept`, writes the figures that do not vary into
/// this file instead, and keeps the limits.
pub(crate) fn check(file: &str, figures: &[Figure], accept: bool) -> TaskResult {
    let path = root().join("xtask/budgets").join(file).with_extension("txt");
    let text = fs::read_to_string(&path).unwrap_or_default();
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty());
    let budgets = lines.map(|line| Budget::parse(line).ok_or(format!("{}: {line}", path.display())));
    let budgets = budgets.collect::<Result<Vec<_>, _>>()?;
    let violations = compare(&budgets, figures);
    if accept {
        return write(&path, &budgets, figures);
    }
    if violations.is_empty() { Ok(()) } else { Err(violations.join("; ").into()) }
}

fn compare(budgets: &[Budget], figures: &[Figure]) -> Vec<String> {
    let mut table = TextTable::new([Right("measured"), Right("committed"), Right("at most"), Left("figure")]);
    let mut violations = Vec::new();
    for figure in figures {
        let budget = budgets.iter().find(|budget| budget.name == figure.name);
        let violation = match budget {
            Some(budget) => budget.violation(figure.value),
            None => Some("has no budget".to_owned()),
        };
        let committed = budget.map_or_else(String::new, Budget::committed_text);
        let max = budget.and_then(|budget| budget.max).map_or_else(String::new, |max| max.to_string());
        let mark = violation.as_ref().map_or_else(String::new, |violation| format!("   <-- {violation}"));
        table.add([figure.value.to_string(), committed, max, format!("{}{mark}", figure.name)]);
        violations
            .extend(violation.map(|violation| format!("{}: {}, {violation}", figure.name, figure.value)));
    }
    print!("{table}");
    let is_measured = |budget: &&Budget| figures.iter().any(|figure| figure.name == budget.name);
    let unmeasured = budgets.iter().filter(|budget| !is_measured(budget));
    violations.extend(unmeasured.map(|budget| format!("{}: has a budget and was not measured", budget.name)));
    violations
}

fn write(path: &PathBuf, budgets: &[Budget], figures: &[Figure]) -> TaskResult {
    let mut text = INTRODUCTION.to_owned();
    for Figure { name, value } in figures {
        let budget = budgets.iter().find(|budget| budget.name == *name);
        let varies = budget.is_some_and(|budget| budget.committed.is_none());
        let value = if varies { VARIES.to_owned() } else { value.to_string() };
        let max = budget.and_then(|budget| budget.max);
        let max = max.map_or_else(|| "-".to_owned(), |max| max.to_string());
        text.push_str(&format!("{name} | {value} | {max}\n"));
    }
    println!("committed to {}", path.display());
    Ok(fs::write(path, text)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget() -> Budget {
        Budget::parse("image: program, bytes | 20000 | 20500").expect("a line")
    }

    #[test]
    fn an_increase_of_five_percent_passes_and_more_fails() {
        let free = Budget { max: None, ..budget() };
        assert_eq!(free.violation(15_000), None);
        assert_eq!(free.violation(21_000), None);
        assert!(free.violation(21_001).is_some());
    }

    #[test]
    fn a_figure_above_its_limit_fails() {
        assert_eq!(budget().violation(20_500), None);
        assert!(budget().violation(20_501).is_some());
    }

    #[test]
    fn a_figure_that_varies_has_a_limit_only() {
        let varying = Budget::parse("load | varies | 100").expect("a line");
        assert_eq!((varying.violation(100), varying.violation(101).is_some()), (None, true));
        assert!(Budget::parse("load | varies | -").is_none());
    }

    #[test]
    fn a_figure_without_a_budget_fails_and_so_does_a_budget_without_a_figure() {
        let figure = |name: &str| [Figure::new(name, 1)];
        assert!(compare(&[budget()], &figure("image: program, bytes")).is_empty());
        assert_eq!(compare(&[budget()], &figure("something else")).len(), 2);
    }

    #[test]
    fn an_invalid_line_is_an_error() {
        assert!(Budget::parse("image: program, bytes | many | -").is_none());
        assert!(Budget::parse("image: program, bytes").is_none());
    }
}
