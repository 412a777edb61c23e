//! `registers`: prints the register table for readers and for other languages.

use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use sevenbot::{Range, Register, table};

use crate::command_error::CommandError;
use crate::session::Session;

/// Print the register table. Needs no arm.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot registers
  sevenbot registers --format c > sevenbot_registers.h
  sevenbot registers --format python > sevenbot_registers.py")]
pub(crate) struct RegistersArgs {
    /// Format of the output.
    #[arg(long, value_enum, default_value_t = TableFormat::Text)]
    format: TableFormat,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TableFormat {
    /// Columns of text.
    Text,
    /// Markdown, as docs/registers.md.
    Markdown,
    /// A JSON array, as with --json.
    Json,
    /// A header for C and C++.
    C,
    /// A Python module.
    Python,
}

pub(crate) fn run(session: &mut Session, args: &RegistersArgs) -> Result<(), CommandError> {
    let format = if session.printer.is_json() { TableFormat::Json } else { args.format };
    let text = match format {
        TableFormat::Text => text(),
        TableFormat::Markdown => table::markdown(),
        TableFormat::Json => json(),
        TableFormat::C => table::c_header(),
        TableFormat::Python => table::python(),
    };
    session.printer.print_raw(text.as_bytes())
}

/// The table as columns of text, with a line of headings.
fn text() -> String {
    let head = ["address", "name", "region", "access", "range", "default", "unit", "map"].map(str::to_owned);
    let cells = |row| {
        let [address, name, region, access, range, default, unit] = table::cells(row);
        [address, name, region, access, range, default, unit, versions(row).join(", ")]
    };
    let rows: Vec<_> = std::iter::once(head).chain(table::rows().map(cells)).collect();
    let width =
        |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max();
    let mut text = String::new();
    for row in &rows {
        let padded = row.iter().enumerate().map(|(column, cell)| {
            let width = width(column).unwrap_or_default();
            format!("{cell:<width$}")
        });
        text.push_str(padded.collect::<Vec<_>>().join("  ").trim_end());
        text.push('\n');
    }
    text
}

/// The maps that have this row.
fn versions(row: &Register) -> Vec<&'static str> {
    table::versions(row).collect()
}

/// A JSON array on one line, with one object per row.
fn json() -> String {
    let rows: Vec<Value> = table::rows().map(object).collect();
    let text = serde_json::to_string(&rows).unwrap_or_default();
    format!("{text}\n")
}

fn object(row: &Register) -> Value {
    let (low, high) = table::range(row).unzip();
    let defaults = row.defaults.map(|byte| row.range.decode(byte));
    let [default, ..] = defaults;
    json!({
        "address": row.address,
        "count": row.count,
        "width": row.range.width(),
        "name": row.name,
        "per_joint": row.per_joint,
        "region": table::region(row.region),
        "access": table::access(row.access),
        "min": low,
        "max": high,
        "sign_magnitude": matches!(row.range, Range::SignMagnitude(_)),
        "biased": matches!(row.range, Range::Biased(_)),
        "maps": versions(row),
        "default": if row.per_joint { json!(defaults) } else { json!(default) },
        "unit": row.unit.symbol(),
        "meaning": table::description(row),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_form_has_every_row() {
        let json: Vec<Value> = serde_json::from_str(&json()).expect("JSON");
        let rows = table::rows().count();
        assert_eq!(json.len(), rows);
        for row in table::rows() {
            assert!(text().lines().any(|line| line.split_whitespace().nth(1) == Some(row.name)));
        }
        assert_eq!(text().lines().count(), rows + 1);
        let maps = |address: u8| {
            json.iter()
                .filter(|row| row["address"] == address)
                .map(|row| row["maps"].clone())
                .collect::<Vec<_>>()
        };
        let width =
            |address: u8| json.iter().find(|row| row["address"] == address).map(|row| row["width"].clone());
        assert_eq!([width(46), width(128)], [1, 2].map(|width| Some(width.into())));
        assert_eq!(maps(13), [serde_json::json!(["2.2"]), serde_json::json!(["2.1"])]);
        assert_eq!(maps(46), [serde_json::json!(["2.2", "2.1"])]);
    }
}
