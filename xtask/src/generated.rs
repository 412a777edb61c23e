//! Generated files, and generated sections of documents, between two marks.

use std::fs;

use crate::run::{TaskResult, root};

/// The path of a file from the root of the workspace, and its required content.
pub(crate) type GeneratedFile = (String, Vec<u8>);

/// The last line of every generated section.
const END: &str = "<!-- end -->\n";

/// The document with `content` in the section that begins after the line `begin`.
pub(crate) fn with_section(document: &str, begin: &str, content: &str) -> TaskResult<Vec<GeneratedFile>> {
    let text = fs::read_to_string(root().join(document))?;
    let replaced =
        replace(&text, begin, content).ok_or_else(|| format!("{document} has no section {begin}"))?;
    Ok(vec![(document.to_owned(), replaced.into_bytes())])
}

fn replace(text: &str, begin: &str, content: &str) -> Option<String> {
    let (before, rest) = text.split_once(begin)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{begin}{content}{END}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_section_is_replaced() {
        let begin = "<!-- begin: b -->\n";
        let text = "before\n<!-- begin: b -->\nold\n<!-- end -->\nafter\n";
        let expected = "before\n<!-- begin: b -->\nnew\n<!-- end -->\nafter\n";
        assert_eq!(replace(text, begin, "new\n").as_deref(), Some(expected));
        assert_eq!(replace("no marks", begin, "new\n"), None);
        assert_eq!(replace("<!-- begin: b -->\nno end", begin, "new\n"), None);
    }
}
