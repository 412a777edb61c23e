//! Converts the names of variables and functions to valid Python names, each of which is used once.

use std::collections::HashSet;

/// Reserved names: the keywords of Python, the names that the written program uses itself, and `__name__`.
const TAKEN: [&str; 42] = [
    "False", "None", "True", "and", "as", "assert", "async", "await", "break", "class", "continue", "def",
    "del", "elif", "else", "except", "finally", "for", "from", "global", "if", "import", "in", "is",
    "lambda", "nonlocal", "not", "or", "pass", "raise", "return", "try", "while", "with", "yield", "arm",
    "int", "range", "sevenbot", "sys", "_", "__name__",
];

/// The names that are taken.
pub(crate) struct Names(HashSet<String>);

impl Names {
    pub(crate) fn new() -> Self {
        Self(TAKEN.iter().map(|&word| word.to_owned()).collect())
    }

    /// Returns a free Python name that resembles `name`, and reserves it. Appends `_2`, `_3` and so on to names that are taken.
    pub(crate) fn give(&mut self, name: &str) -> String {
        let like = identifier(name);
        let others = (2..).map(|number| format!("{like}_{number}"));
        let free = std::iter::once(like.clone()).chain(others).find(|name| !self.0.contains(name));
        let name = free.unwrap_or(like);
        self.0.insert(name.clone());
        name
    }
}

/// Replaces each character by `_`, except ASCII letters, digits and Chinese characters. A name that is empty or begins with a
/// digit gets `_` in front.
fn identifier(name: &str) -> String {
    let is_plain =
        |letter: &char| letter.is_ascii_alphanumeric() || ('\u{4e00}'..='\u{9fff}').contains(letter);
    let mut text: String = name.chars().map(|letter| if is_plain(&letter) { letter } else { '_' }).collect();
    if text.chars().next().is_none_or(|first| first.is_ascii_digit()) {
        text.insert(0, '_');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_identifiers_and_different() {
        let mut names = Names::new();
        let given = ["height", "my height", "my-height", "2nd", "", "for", "高度", "arm"]
            .map(|name| names.give(name));
        assert_eq!(given, ["height", "my_height", "my_height_2", "_2nd", "__2", "for_2", "高度", "arm_2"]);
    }
}
