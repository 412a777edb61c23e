//! What can go wrong with a servo, and how it is said on a command line.

use std::str::FromStr;

use protocol_core::time::Duration;

/// A defect of one simulated servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It is unplugged: it hears nothing, says nothing and drives nothing. Plugged in again, it starts
    /// afresh.
    Missing,
    /// It answers so much later than it should.
    Late(Duration),
    /// Every n-th of its answers has a wrong checksum; 1 means all of them.
    Garbled(u32),
    /// Something keeps it from turning.
    Stuck,
    /// It starts again by itself each time this has passed: its torque and its goal are forgotten, and it hears
    /// nothing for 200 ms.
    Restarting(Duration),
}

/// A word that is no fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown fault '{0}': use missing, late, late=MILLISECONDS, garbled, garbled=EVERY_NTH, \
         restarting=MILLISECONDS or stuck"
)]
pub struct UnknownFault(String);

/// `late` is 30 ms late; `garbled` is always.
impl FromStr for Fault {
    type Err = UnknownFault;

    fn from_str(word: &str) -> Result<Self, UnknownFault> {
        let fault = match word.split_once('=') {
            None => plain(word),
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

fn plain(word: &str) -> Option<Fault> {
    match word {
        "missing" => Some(Fault::Missing),
        "late" => Some(Fault::Late(Duration::from_millis(30))),
        "garbled" => Some(Fault::Garbled(1)),
        "stuck" => Some(Fault::Stuck),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_words() {
        assert_eq!("missing".parse(), Ok(Fault::Missing));
        assert_eq!("late".parse(), Ok(Fault::Late(Duration::from_millis(30))));
        assert_eq!("late=5".parse(), Ok(Fault::Late(Duration::from_millis(5))));
        assert_eq!("garbled".parse(), Ok(Fault::Garbled(1)));
        assert_eq!("garbled=10".parse(), Ok(Fault::Garbled(10)));
        assert_eq!("stuck".parse(), Ok(Fault::Stuck));
        assert_eq!("restarting=2000".parse(), Ok(Fault::Restarting(Duration::from_millis(2_000))));
    }

    #[test]
    fn other_words_are_refused_with_a_hint() {
        for word in
            ["", "Missing", "late=", "late=-1", "garbled=0", "garbled=x", "stuck=1", "restarting=0", "lost"]
        {
            let error = word.parse::<Fault>().unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("use missing"), "{error}");
        }
    }
}
