//! The colours of the text: the same meaning has the same one everywhere.

use anstyle::{AnsiColor, Style};

/// For headings.
pub(crate) const BOLD: Style = Style::new().bold();
/// For what is well.
pub(crate) const GOOD: Style = AnsiColor::Green.on_default();
/// For what is not.
pub(crate) const BAD: Style = AnsiColor::Red.on_default().bold();
/// For what deserves a look.
pub(crate) const WARNING: Style = AnsiColor::Yellow.on_default().bold();
