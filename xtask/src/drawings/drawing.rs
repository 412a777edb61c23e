//! One schematic: its parts on a sheet.

use super::part::Part;
use super::sheet::Sheet;

/// A schematic.
pub(super) struct Drawing {
    /// The name of its file.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    /// Width and height in grid units.
    pub(super) size: (i32, i32),
    pub(super) parts: Vec<Part>,
}

impl Drawing {
    pub(super) fn svg(&self) -> String {
        let mut sheet = Sheet::new(self.size, self.title);
        for part in &self.parts {
            part.draw(&mut sheet);
        }
        sheet.finish()
    }
}
