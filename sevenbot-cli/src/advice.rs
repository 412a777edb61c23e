//! Advice to the user after a failure, the most likely cause first. May be empty.

use sevenbot::servo_bench::ServoError;
use sevenbot::{Error, OpenError, ReceiveCounts};

/// Advice after a port or an arm could not be opened.
pub(crate) fn opening(error: &OpenError) -> Vec<String> {
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
        ],
        OpenError::Unusable(_) => {
            &["does this name belong to a serial port, and does it take this baud rate?"]
        }
        OpenError::WrongDevice { .. } => {
            &["is this the right port? `sevenbot ports` says which ones lead to arms"]
        }
    };
    owned(lines)
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
pub(crate) const fn exchange(error: &Error) -> &'static [&'static str] {
    match error {
        Error::OutsideMap { .. } => &[],
        Error::NoAnswer { received: ReceiveCounts { bytes: 0, .. }, .. } => &[
            "has the arm power, and is its cable plugged in at both ends?",
            "is this the right port? `sevenbot ports` says which ones lead to arms",
            "is the baud rate right (--baud)? `sevenbot --port PORT baud --find` tries all of them",
        ],
        Error::NoAnswer { .. } => &[
            "bytes arrive, but no frames: probably the baud rate is wrong (--baud); \
             `sevenbot --port PORT baud --find` tries all rates",
            "is this the right port, and no other program reading from it?",
        ],
        Error::Port(_) => &["was the cable pulled, or the simulator ended?"],
    }
}

/// Advice after an exchange with a servo failed.
pub(crate) const fn servo(error: &ServoError) -> &'static [&'static str] {
    match error {
        ServoError::NoAnswer { received: ReceiveCounts { damaged_frames: 1.., .. }, .. } => &[
            "damaged answers: two servos with the same id, a loose plug, or a pull-up that is too weak",
            "leave one servo on the bus, and try again",
        ],
        ServoError::NoAnswer { .. } => &[
            "do the servos have their own power? The adapter does not supply them",
            "is the signal wire on the adapter's servo side, and the ground common to both?",
            "`sevenbot servo scan` finds ids and baud rates; `--rate` sets the rate for one command",
            "is the arm's controller off the bus? Two masters disturb each other",
        ],
        ServoError::NotTaken { .. } => {
            &["an overload or a voltage fault may make a servo refuse: see `sevenbot servo info`"]
        }
        ServoError::NoSuchRate { .. } => &["choose other rates with --rates, or use another adapter"],
        ServoError::Port(_) => &["was the adapter unplugged?"],
    }
}

/// The lines as strings.
pub(crate) fn owned(lines: &[&str]) -> Vec<String> {
    lines.iter().map(|&line| line.to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_denied_permission_names_the_group_to_join() {
        let denied = OpenError::PermissionDenied { group: Some("dialout".to_owned()) };
        assert!(opening(&denied).concat().contains("usermod -aG dialout $USER"));
    }
}
