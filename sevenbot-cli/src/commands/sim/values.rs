//! Parsers of arguments: times, weights, speeds, and actions of the hand.

use serde_json::{Value, json};

/// Parses a duration into milliseconds: 250ms, 2s, 1.5s or 3min.
pub(super) fn millis(text: &str) -> Result<u64, &'static str> {
    const WANTED: &str = "use a time of 1 ms or more with its unit, as 250ms, 2s or 3min";
    let digits = text.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
    let factor = match text.get(digits.len()..) {
        Some("ms") => 1.0,
        Some("s") => 1_000.0,
        Some("min") => 60_000.0,
        _ => return Err(WANTED),
    };
    let millis = digits.parse::<f64>().map_err(|_| WANTED)? * factor;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the range")]
    if (1.0..=1e12).contains(&millis) { Ok(millis.round() as u64) } else { Err(WANTED) }
}

/// Parses a weight in grams, as 150g or 150.
pub(super) fn grams(text: &str) -> Result<u16, &'static str> {
    text.strip_suffix('g').unwrap_or(text).parse().map_err(|_| "use grams from 0 to 1000, as 150g")
}

/// Parses a speed, as 50x, 50 or max.
pub(super) fn factor(text: &str) -> Result<Value, &'static str> {
    if text == "max" {
        return Ok(json!(text));
    }
    let factor = text.strip_suffix('x').unwrap_or(text).parse().ok();
    let factor = factor.filter(|factor: &f64| (0.001..=1_000.0).contains(factor));
    factor.map(|factor| json!(factor)).ok_or("use a factor from 0.001 to 1000, as 50x or 0.5, or max")
}

/// Parses an action of the hand: an angle in degrees, `hold` or `let-go`.
pub(super) fn hand(text: &str) -> Result<Value, &'static str> {
    match text {
        "hold" | "let-go" => Ok(json!(text)),
        degrees => {
            let degrees = degrees.parse().ok().filter(|degrees: &f64| (0.0..=180.0).contains(degrees));
            degrees
                .map(|degrees| json!(degrees))
                .ok_or("use an angle in degrees from 0 to 180, hold or let-go")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_a_unit() {
        for (text, value) in
            [("250ms", 250), ("2s", 2_000), ("1.5s", 1_500), ("3min", 180_000), ("0.0014s", 1)]
        {
            assert_eq!(millis(text), Ok(value), "{text}");
        }
        for wrong in ["250", "0ms", "-1s", "s", "", "2h", "infs", "nans", "1e99s"] {
            assert!(millis(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_speed_is_a_factor_within_its_range() {
        assert_eq!((factor("50x"), factor("0.5")), (Ok(json!(50.0)), Ok(json!(0.5))));
        assert_eq!(factor("max"), Ok(json!("max")));
        for wrong in ["NaN", "inf", "0", "-1", "1001x", "x", "fast"] {
            assert!(factor(wrong).is_err(), "{wrong}");
        }
        assert!(hand("NaN").is_err() && hand("181").is_err() && hand("90").is_ok());
    }

    #[test]
    fn weights_are_grams() {
        assert_eq!((grams("150g"), grams("0")), (Ok(150), Ok(0)));
        assert!(grams("1kg").is_err() && grams("-1").is_err());
    }
}
