//! Figures that are held: each is compared with what was committed, and with what it may be at most. Less is better
//! in all of them.
//!
//! ```text
//!   xtask/budgets/size.txt:    name | committed | at most
//! ```
//!
//! Knows nothing of where a figure comes from.

use std::fs;
use std::path::PathBuf;

use crate::run::{Outcome, root};
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

/// How much worse than committed a figure may get, in percent.
const TOLERANCE: u64 = 5;
/// What stands at the beginning of each file of budgets.
const INTRODUCTION: &str = "\
# name | committed | at most
# Less is better. `cargo xtask test` fails where a figure is more than 5 % above the one committed, or above the most
# that it may be; `cargo xtask size --accept` and `cargo xtask count --accept` commit what they measure.
";

/// Something that was measured or counted.
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
    committed: u64,
    most: Option<u64>,
}

impl Budget {
    fn parse(line: &str) -> Option<Self> {
        let mut cells = line.split('|').map(str::trim);
        let (name, committed, most) = (cells.next()?, cells.next()?, cells.next()?);
        let most = if most == "-" { None } else { Some(most.parse().ok()?) };
        Some(Self { name: name.to_owned(), committed: committed.parse().ok()?, most })
    }

    /// What is wrong with a figure.
    fn fault_of(&self, value: u64) -> Option<String> {
        let limit = self.committed + self.committed * TOLERANCE / 100;
        match self.most {
            Some(most) if value > most => Some(format!("may be {most} at most")),
            _ if value > limit => Some(format!("was {}: more than {TOLERANCE} % worse", self.committed)),
            _ => None,
        }
    }
}

/// Prints the figures, and fails if one is worse than its budget in `xtask/budgets/<file>.txt` allows. With
/// `accept` they are committed instead; what each may be at most stays.
pub(crate) fn hold(file: &str, figures: &[Figure], accept: bool) -> Outcome {
    let path = root().join("xtask/budgets").join(file).with_extension("txt");
    let text = fs::read_to_string(&path).unwrap_or_default();
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty());
    let budgets = lines.map(|line| Budget::parse(line).ok_or(format!("{}: {line}", path.display())));
    let budgets = budgets.collect::<Result<Vec<_>, _>>()?;
    let faults = compare(&budgets, figures);
    if accept {
        return write(&path, &budgets, figures);
    }
    if faults.is_empty() { Ok(()) } else { Err(faults.join("; ").into()) }
}

fn compare(budgets: &[Budget], figures: &[Figure]) -> Vec<String> {
    let mut table = TextTable::new([Right("measured"), Right("committed"), Right("at most"), Left("figure")]);
    let mut faults = Vec::new();
    for figure in figures {
        let budget = budgets.iter().find(|budget| budget.name == figure.name);
        let fault = match budget {
            Some(budget) => budget.fault_of(figure.value),
            None => Some("has no budget".to_owned()),
        };
        let committed = budget.map_or_else(String::new, |budget| budget.committed.to_string());
        let most = budget.and_then(|budget| budget.most).map_or_else(String::new, |most| most.to_string());
        let mark = fault.as_ref().map_or_else(String::new, |fault| format!("   <-- {fault}"));
        table.add([figure.value.to_string(), committed, most, format!("{}{mark}", figure.name)]);
        faults.extend(fault.map(|fault| format!("{}: {}, {fault}", figure.name, figure.value)));
    }
    print!("{table}");
    let is_measured = |budget: &&Budget| figures.iter().any(|figure| figure.name == budget.name);
    let lost = budgets.iter().filter(|budget| !is_measured(budget));
    faults.extend(lost.map(|budget| format!("{}: has a budget and was not measured", budget.name)));
    faults
}

fn write(path: &PathBuf, budgets: &[Budget], figures: &[Figure]) -> Outcome {
    let mut text = INTRODUCTION.to_owned();
    for Figure { name, value } in figures {
        let most = budgets.iter().find(|budget| budget.name == *name).and_then(|budget| budget.most);
        let most = most.map_or_else(|| "-".to_owned(), |most| most.to_string());
        text.push_str(&format!("{name} | {value} | {most}\n"));
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
    fn five_percent_worse_is_let_pass_and_more_is_not() {
        let free = Budget { most: None, ..budget() };
        assert_eq!(free.fault_of(15_000), None);
        assert_eq!(free.fault_of(21_000), None);
        assert!(free.fault_of(21_001).is_some());
    }

    #[test]
    fn nothing_may_be_above_the_most_that_it_may_be() {
        assert_eq!(budget().fault_of(20_500), None);
        assert!(budget().fault_of(20_501).is_some());
    }

    #[test]
    fn a_figure_without_a_budget_fails_and_so_does_a_budget_without_a_figure() {
        let figure = |name: &str| [Figure::new(name, 1)];
        assert!(compare(&[budget()], &figure("image: program, bytes")).is_empty());
        assert_eq!(compare(&[budget()], &figure("something else")).len(), 2);
    }

    #[test]
    fn a_line_that_is_no_budget_is_told() {
        assert!(Budget::parse("image: program, bytes | many | -").is_none());
        assert!(Budget::parse("image: program, bytes").is_none());
    }
}
