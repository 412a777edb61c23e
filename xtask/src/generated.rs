//! Generated sections of a document, between two marks.

use std::fs;

use crate::run::{TaskResult, root};

/// The last line of every generated section.
const END: &str = "<!-- end -->\n";

/// A section of a document.
pub(crate) struct GeneratedSection {
    /// The document, from the root of the workspace.
    pub(crate) document: &'static str,
    /// The line before the section.
    pub(crate) begin: &'static str,
}

impl GeneratedSection {
    /// Writes the section.
    pub(crate) fn write(&self, content: &str) -> TaskResult {
        let path = root().join(self.document);
        let text = fs::read_to_string(&path)?;
        Ok(fs::write(path, self.replace(&text, content)?)?)
    }

    /// Fails if the section has another content.
    pub(crate) fn check(&self, content: &str) -> TaskResult {
        let text = fs::read_to_string(root().join(self.document))?;
        if self.replace(&text, content)? == text {
            return Ok(());
        }
        Err(format!("{} is out of date: run `cargo xtask docs`", self.document).into())
    }

    fn replace(&self, text: &str, content: &str) -> TaskResult<String> {
        let Self { document, begin } = self;
        let (before, rest) =
            text.split_once(begin).ok_or_else(|| format!("{document} has no line {begin}"))?;
        let (_, after) =
            rest.split_once(END).ok_or_else(|| format!("{document} has no end after {begin}"))?;
        Ok(format!("{before}{begin}{content}{END}{after}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_section_is_replaced() {
        let section = GeneratedSection { document: "a.md", begin: "<!-- begin: b -->\n" };
        let text = "before\n<!-- begin: b -->\nold\n<!-- end -->\nafter\n";
        let expected = "before\n<!-- begin: b -->\nnew\n<!-- end -->\nafter\n";
        assert_eq!(section.replace(text, "new\n").unwrap(), expected);
        assert!(section.replace("no marks", "new\n").is_err());
        assert!(section.replace("<!-- begin: b -->\nno end", "new\n").is_err());
    }
}
