//! Names of pupils: bounded, without characters that change how other text is shown, and unique in the class.

/// The longest name, in characters.
pub const LONGEST_NAME: usize = 24;

/// True for characters that are not shown, or that change the direction of the text around them.
const fn is_invisible(character: char) -> bool {
    matches!(character, '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{180b}'..='\u{180f}'
        | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{2800}' | '\u{3164}'
        | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{ffa0}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// The name in a text: one line without invisible characters and without spaces at its ends, cut after [`LONGEST_NAME`]
/// characters. `None` if it has no letter and no digit.
///
/// ```
/// use classroom::name::clean;
///
/// assert_eq!(clean("  Mia \n Lee ").as_deref(), Some("Mia Lee"));
/// assert_eq!(clean(" \u{202e} \u{3164} "), None);
/// ```
#[must_use]
pub fn clean(text: &str) -> Option<String> {
    let shown = |word: &str| word.chars().filter(|&it| !it.is_control() && !is_invisible(it)).collect();
    let words: Vec<String> =
        text.split_whitespace().map(shown).filter(|word: &String| !word.is_empty()).collect();
    let name = cut(&words.join(" "), LONGEST_NAME);
    name.chars().any(char::is_alphanumeric).then_some(name)
}

fn cut(text: &str, most: usize) -> String {
    text.chars().take(most).collect::<String>().trim_end().to_owned()
}

/// The name if it is free; otherwise the name with the lowest number that makes it unique: `Mia 2`.
pub(crate) fn unique(name: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2..).map(|number: u32| {
        let number = format!(" {number}");
        cut(name, LONGEST_NAME - number.chars().count()) + &number
    });
    let is_free = |wanted: &String| !is_taken(wanted);
    std::iter::once(name.to_owned()).chain(numbered).find(is_free).unwrap_or_else(|| name.to_owned())
}

/// True if both names are the same in lower case.
pub(crate) fn is_same(one: &str, other: &str) -> bool {
    one.to_lowercase() == other.to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_second_mia_gets_a_number() {
        let taken = |names: &'static [&str]| move |name: &str| names.iter().any(|it| is_same(it, name));
        assert_eq!(unique("Mia", taken(&["Leo"])), "Mia");
        assert_eq!(unique("mia", taken(&["Mia"])), "mia 2");
        assert_eq!(unique("Mia", taken(&["Mia", "Mia 2"])), "Mia 3");
        let long = "x".repeat(LONGEST_NAME);
        assert_eq!(unique(&long, |name| name == long), format!("{} 2", "x".repeat(LONGEST_NAME - 2)));
    }

    proptest! {
        #[test]
        fn a_clean_name_is_bounded_shown_and_stays_as_it_is(text in any::<String>()) {
            if let Some(name) = clean(&text) {
                prop_assert!((1..=LONGEST_NAME).contains(&name.chars().count()));
                prop_assert!(!name.chars().any(|it| it.is_control() || is_invisible(it)));
                prop_assert_eq!(clean(&name), Some(name.clone()));
                prop_assert!(unique(&name, |it| it == name).chars().count() <= LONGEST_NAME);
            }
        }
    }
}
