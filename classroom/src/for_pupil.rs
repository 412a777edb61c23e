//! Parses the messages to a pupil's tab. This parser is part of the page, which has to be small; the derived parser would
//! take three times the code.

use serde_json::{Map, Value};

use crate::message::{LeaseEnd, LentArm, Refusal, ToPupil};

impl ToPupil {
    /// Parses a message in JSON; `None` if the text is not a message to a pupil.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let message: Value = serde_json::from_str(text).ok()?;
        let (kind, content) = message.as_object()?.iter().next()?;
        if kind == "refused" {
            return Some(Self::Refused(refusal(content.as_str()?)?));
        }
        let content = content.as_object()?;
        Some(match kind.as_str() {
            "welcome" => Self::Welcome { name: text_of(content, "name")?, key: text_of(content, "key")? },
            "stop" => Self::Stop { number: number_of(content, "number")? },
            "message" => Self::Message { text: text_of(content, "text")? },
            "ask" => Self::Ask {
                arm: content.get("arm")?.as_object().and_then(lent_arm),
                over: content.get("over")?.as_str().and_then(lease_end),
            },
            _ => return None,
        })
    }
}

fn text_of(content: &Map<String, Value>, name: &str) -> Option<String> {
    content.get(name)?.as_str().map(str::to_owned)
}

fn number_of(content: &Map<String, Value>, name: &str) -> Option<u32> {
    content.get(name)?.as_u64()?.try_into().ok()
}

fn refusal(word: &str) -> Option<Refusal> {
    Some(match word {
        "no_name" => Refusal::NoName,
        "full" => Refusal::Full,
        "other_tab" => Refusal::OtherTab,
        "bad_message" => Refusal::BadMessage,
        _ => return None,
    })
}

fn lent_arm(content: &Map<String, Value>) -> Option<LentArm> {
    Some(LentArm {
        holder: text_of(content, "holder")?,
        seconds: number_of(content, "seconds")?,
        is_yours: content.get("is_yours")?.as_bool()?,
    })
}

fn lease_end(word: &str) -> Option<LeaseEnd> {
    Some(match word {
        "time" => LeaseEnd::Time,
        "taken_back" => LeaseEnd::TakenBack,
        "lost" => LeaseEnd::Lost,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_message_is_parsed_as_it_was_written() {
        let arm = |is_yours| LentArm { holder: "Mia \"\u{4f60}".to_owned(), seconds: 281, is_yours };
        let mut messages = vec![
            ToPupil::Welcome { name: "Mia".to_owned(), key: "key".to_owned() },
            ToPupil::Stop { number: u32::MAX },
            ToPupil::Message { text: String::new() },
            ToPupil::Ask { arm: Some(arm(true)), over: None },
            ToPupil::Ask { arm: Some(arm(false)), over: None },
        ];
        let refusals = [Refusal::NoName, Refusal::Full, Refusal::OtherTab, Refusal::BadMessage];
        messages.extend(refusals.map(ToPupil::Refused));
        let ends = [None, Some(LeaseEnd::Time), Some(LeaseEnd::TakenBack), Some(LeaseEnd::Lost)];
        messages.extend(ends.map(|over| ToPupil::Ask { arm: None, over }));
        for message in messages {
            let text = serde_json::to_string(&message).unwrap_or_default();
            assert_eq!(ToPupil::parse(&text), Some(message), "{text}");
        }
    }

    #[test]
    fn what_is_no_message_is_none() {
        for text in ["", "[]", "{}", r#"{"stop":{}}"#, r#"{"stop":{"number":-1}}"#, r#"{"refused":"x"}"#, "7"]
        {
            assert_eq!(ToPupil::parse(text), None, "{text}");
        }
    }
}
