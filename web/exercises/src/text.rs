//! Texts in the languages of the page.

use serde::Deserialize;
use serde_json::Value;

/// A text in the languages of the page. In a file it is a string for all languages, or an object with `en` and `zh-CN`.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq)]
#[serde(try_from = "Value")]
pub enum Text {
    /// The same text for all languages.
    One(String),
    /// One text for each language.
    Each {
        /// English.
        en: String,
        /// Simplified Chinese.
        zh: String,
    },
}

impl TryFrom<Value> for Text {
    type Error = &'static str;

    fn try_from(value: Value) -> Result<Self, Self::Error> {
        let member = |name| value.get(name).and_then(Value::as_str).map(str::to_owned);
        match (value.as_str(), member("en"), member("zh-CN")) {
            (Some(text), ..) => Ok(Self::One(text.to_owned())),
            (_, Some(en), Some(zh)) => Ok(Self::Each { en, zh }),
            _ => Err("a text is \"...\" or {\"en\": \"...\", \"zh-CN\": \"...\"}"),
        }
    }
}

impl Text {
    /// The text in the language of this tag: `zh-CN`, or English for any other tag.
    #[must_use]
    pub fn of(&self, tag: &str) -> &str {
        match self {
            Self::One(text) => text,
            Self::Each { en, zh } => {
                if tag == "zh-CN" {
                    zh
                } else {
                    en
                }
            }
        }
    }
}
