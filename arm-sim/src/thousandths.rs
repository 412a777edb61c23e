//! The text form of whole thousandths: numbers with at most three decimals.

use core::fmt::{self, Display, Formatter};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Thousandths(pub(crate) i32);

impl Thousandths {
    /// Parses a number with at most three decimals and at most four digits before them.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (is_negative, size) = text.strip_prefix('-').map_or((false, text), |size| (true, size));
        let (whole, decimals) = size.split_once('.').unwrap_or((size, "0"));
        let is_number = |text: &str, most| {
            (1..=most).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit())
        };
        if !is_number(whole, 4) || !is_number(decimals, 3) {
            return None;
        }
        let scale = match decimals.len() {
            1 => 100,
            2 => 10,
            _ => 1,
        };
        let thousandths = whole.parse::<i32>().ok()? * 1_000 + decimals.parse::<i32>().ok()? * scale;
        Some(Self(if is_negative { -thousandths } else { thousandths }))
    }
}

impl Display for Thousandths {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let size = self.0.unsigned_abs();
        let sign = if self.0 < 0 { "-" } else { "" };
        write!(out, "{sign}{}", size / 1_000)?;
        match size % 1_000 {
            0 => Ok(()),
            part if part % 100 == 0 => write!(out, ".{}", part / 100),
            part if part % 10 == 0 => write!(out, ".{:02}", part / 10),
            part => write!(out, ".{part:03}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn numbers_are_printed_as_they_are_read() {
        for text in ["0", "60", "60.5", "0.007", "-40.25", "9999.999", "-0.1"] {
            assert_eq!(Thousandths::parse(text).map(|number| number.to_string()), Some(text.to_string()));
        }
        for text in ["", "-", "1.", ".5", "1.2345", "10000", "+1", "6e1", "NaN", "--1", "1-"] {
            assert_eq!(Thousandths::parse(text), None, "{text}");
        }
    }
}
