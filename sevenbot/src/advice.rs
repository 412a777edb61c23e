//! Advice to the user after a failure, the most likely cause first. May be empty.

use crate::error::{Error, OpenError, ReceiveCounts};

/// Advice after a port or an arm could not be opened.
#[must_use]
pub fn opening(error: &OpenError) -> Vec<String> {
    let lines: &[&str] = match error {
        OpenError::PermissionDenied { group } => return vec![join(group.as_deref())],
        OpenError::Silent(error) => exchange(error),
        OpenError::NotFound => &[
            "is the arm plugged in, or the simulator started?",
            "a port may have a new name after it was plugged in again",
            "`sevenbot ports` lists the ports",
        ],
        OpenError::Busy => &[
            "close the other program: a terminal, a browser page, a second sevenbot",
            "on Linux, `fuser -v PORT` names it",
            "`sevenbot serve` shares an arm between programs: start it instead, and give each program a port of it",
        ],
        OpenError::Unusable(_) => {
            &["does this name belong to a serial port, and does it take this baud rate?"]
        }
        OpenError::WrongDevice { .. } => {
            &["is this the right port? `sevenbot ports` says which ones lead to arms"]
        }
    };
    lines.iter().map(|&line| line.to_owned()).collect()
}

fn join(group: Option<&str>) -> String {
    match group {
        Some("root") => "only root may open it, because of a udev rule or another kernel driver".to_owned(),
        Some(group) => {
            format!(
                "join the group that may open it: `sudo usermod -aG {group} $USER`, then log out and in again"
            )
        }
        None if cfg!(unix) => {
            "`ls -lL PORT` shows the owner and the group that may open it (often dialout or uucp); \
             join the group and log in again"
                .to_owned()
        }
        None => "is another program using it, or does it need an administrator?".to_owned(),
    }
}

/// Advice after an exchange with an arm failed.
#[must_use]
pub const fn exchange(error: &Error) -> &'static [&'static str] {
    match error {
        Error::OutsideMap { .. } => &[],
        Error::NoAnswer { received: ReceiveCounts { bytes: 0, .. }, .. } => &[
            "has the arm power, and is its cable plugged in at both ends?",
            "is this the right port? `sevenbot ports` says which ones lead to arms",
            "is the baud rate right (--baud)? `sevenbot --port PORT baud --find` tries all of them",
        ],
        Error::NoAnswer { received: ReceiveCounts { other_frames: 1.., .. }, .. } => &[
            "the arm sent frames, and then no answer: was it switched off, or has its controller stopped? Switch it off and on",
            "does another program use the same arm? `sevenbot serve` shares it",
        ],
        Error::NoAnswer { .. } => &[
            "bytes arrive, but no frames: probably the baud rate is wrong (--baud); \
             `sevenbot --port PORT baud --find` tries all rates",
            "is this the right port, and no other program reading from it?",
        ],
        Error::Port(_) => &["was the cable pulled, or the simulator ended?"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arm_that_fell_silent_is_not_taken_for_a_wrong_baud_rate() {
        let received =
            |bytes, other_frames| ReceiveCounts { bytes, other_frames, ..ReceiveCounts::default() };
        let advice = |received| {
            let (span, waited) = (host_link::Span::one(0), std::time::Duration::ZERO);
            exchange(&Error::NoAnswer { span, attempts: 1, waited, received }).concat()
        };
        assert!(advice(received(700, 50)).contains("has its controller stopped?"));
        assert!(advice(received(700, 0)).contains("the baud rate is wrong"));
    }

    #[test]
    fn a_denied_permission_names_the_group_to_join() {
        let denied = OpenError::PermissionDenied { group: Some("dialout".to_owned()) };
        assert!(opening(&denied).concat().contains("usermod -aG dialout $USER"));
    }
}
