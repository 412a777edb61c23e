//! A text table: columns as wide as their longest cell, with two spaces between them.

use std::fmt::{self, Display};

/// A column with its heading.
#[derive(Clone, Copy, Debug)]
pub enum Column {
    /// Aligned to the left.
    Left(&'static str),
    /// Aligned to the right.
    Right(&'static str),
}

/// A table that grows by rows, and prints itself as text.
#[derive(Clone, Debug)]
pub struct TextTable {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

impl TextTable {
    /// A table with these columns, from left to right, and no rows yet.
    #[must_use]
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self { columns: columns.into_iter().collect(), rows: Vec::new() }
    }

    /// Adds a row: one cell for each column. Missing cells are empty.
    pub fn add(&mut self, cells: impl IntoIterator<Item = impl ToString>) {
        self.rows.push(cells.into_iter().map(|cell| cell.to_string()).collect());
    }

    fn cells(&self, index: usize) -> impl Iterator<Item = &str> {
        self.rows.iter().map(move |row| row.get(index).map_or("", String::as_str))
    }

    fn width(&self, index: usize, heading: &str) -> usize {
        self.cells(index).chain([heading]).map(|cell| cell.chars().count()).max().unwrap_or(0)
    }
}

impl Column {
    const fn heading(&self) -> &'static str {
        let (Self::Left(heading) | Self::Right(heading)) = self;
        heading
    }

    fn pad(&self, cell: &str, width: usize) -> String {
        match self {
            Self::Left(_) => format!("{cell:<width$}"),
            Self::Right(_) => format!("{cell:>width$}"),
        }
    }
}

impl Display for TextTable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let headings = self.columns.iter().map(|column| column.heading().to_owned()).collect();
        let columns = self.columns.iter().enumerate();
        let widths: Vec<_> = columns.map(|(index, column)| self.width(index, column.heading())).collect();
        for row in std::iter::once(&headings).chain(&self.rows) {
            let cells = row.iter().map(String::as_str).chain(std::iter::repeat(""));
            let columns = self.columns.iter().zip(&widths).zip(cells);
            let cells: Vec<_> = columns.map(|((column, &width), cell)| column.pad(cell, width)).collect();
            writeln!(out, "{}", cells.join("  ").trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::Column::{Left, Right};
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_longest_cell() {
        let mut table = TextTable::new([Left("name"), Right("bytes"), Left("")]);
        table.add(["a longer name", "7", "note"]);
        table.add(["µ", "123456"]);
        let expected = "\
name            bytes
a longer name       7  note
µ              123456
";
        assert_eq!(table.to_string(), expected);
    }
}
