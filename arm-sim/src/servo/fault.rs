//! The faults of a servo, and their names on a command line.

use alloc::borrow::ToOwned;
use alloc::string::String;
use core::fmt::{self, Display, Formatter};
use core::str::FromStr;

use protocol_core::time::Duration;

/// A fault of a simulated servo. Its effects are counted in frames to the servo (missing), answers (late, garbled),
/// milliseconds (stuck) or restarts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ServoFault {
    /// The servo has no power: it executes no frame, sends no answer and drives nothing. When the fault is removed, it starts.
    Missing,
    /// The servo's answers are this much later than usual.
    Late(Duration),
    /// Every n-th answer of the servo has a wrong checksum; 1 means all of them.
    Garbled(u32),
    /// Something keeps the servo from turning.
    Stuck,
    /// The servo restarts once in each period of this length: torque and goal are lost, and it executes no frame for
    /// [`ServoConfig::boot_time`](super::ServoConfig::boot_time), by default 200 ms.
    Restarting(Duration),
}

/// The word is not a fault of a servo.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown fault '{0}': use missing, late, late=MILLISECONDS, garbled, garbled=EVERY_NTH, \
         restarting=MILLISECONDS or stuck"
)]
pub struct UnknownFault(String);

/// `late` without a value means 30 ms, and `garbled` without a value every answer.
impl FromStr for ServoFault {
    type Err = UnknownFault;

    fn from_str(word: &str) -> Result<Self, UnknownFault> {
        let fault = match word.split_once('=') {
            None => without_value(word),
            Some(("late", millis)) => {
                millis.parse().ok().map(|millis| Self::Late(Duration::from_millis(millis)))
            }
            Some(("garbled", every)) => every.parse().ok().filter(|&every| every > 0).map(Self::Garbled),
            Some(("restarting", millis)) => {
                let millis = millis.parse().ok().filter(|&millis| millis > 0);
                millis.map(|millis| Self::Restarting(Duration::from_millis(millis)))
            }
            Some(_) => None,
        };
        fault.ok_or_else(|| UnknownFault(word.to_owned()))
    }
}

fn without_value(word: &str) -> Option<ServoFault> {
    match word {
        "missing" => Some(ServoFault::Missing),
        "late" => Some(ServoFault::Late(Duration::from_millis(30))),
        "garbled" => Some(ServoFault::Garbled(1)),
        "stuck" => Some(ServoFault::Stuck),
        _ => None,
    }
}

impl Display for ServoFault {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => out.write_str("missing"),
            Self::Late(by) => write!(out, "late={}", by.as_micros() / 1_000),
            Self::Garbled(1) => out.write_str("garbled"),
            Self::Garbled(every) => write!(out, "garbled={every}"),
            Self::Stuck => out.write_str("stuck"),
            Self::Restarting(every) => write!(out, "restarting={}", every.as_micros() / 1_000),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_printed_as_it_is_read() {
        for word in ["missing", "late=30", "garbled", "garbled=10", "stuck", "restarting=2000"] {
            assert_eq!(word.parse::<ServoFault>().unwrap().to_string(), word);
        }
    }

    #[test]
    fn each_fault_has_a_name() {
        assert_eq!("missing".parse(), Ok(ServoFault::Missing));
        assert_eq!("late".parse(), Ok(ServoFault::Late(Duration::from_millis(30))));
        assert_eq!("late=5".parse(), Ok(ServoFault::Late(Duration::from_millis(5))));
        assert_eq!("garbled".parse(), Ok(ServoFault::Garbled(1)));
        assert_eq!("garbled=10".parse(), Ok(ServoFault::Garbled(10)));
        assert_eq!("stuck".parse(), Ok(ServoFault::Stuck));
        assert_eq!("restarting=2000".parse(), Ok(ServoFault::Restarting(Duration::from_millis(2_000))));
    }

    #[test]
    fn other_words_are_refused_with_the_possible_ones() {
        for word in
            ["", "Missing", "late=", "late=-1", "garbled=0", "garbled=x", "stuck=1", "restarting=0", "lost"]
        {
            let error = word.parse::<ServoFault>().unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("use missing"), "{error}");
        }
    }
}
