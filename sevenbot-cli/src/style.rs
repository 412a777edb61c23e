//! The colours of the text output.

use anstyle::{AnsiColor, Style};

/// Headings, and the word `note`.
pub(crate) const BOLD: Style = Style::new().bold();
pub(crate) const GOOD: Style = AnsiColor::Green.on_default();
/// Faults and errors.
pub(crate) const BAD: Style = AnsiColor::Red.on_default().bold();
/// Warnings, and acceptable offsets.
pub(crate) const WARNING: Style = AnsiColor::Yellow.on_default().bold();
