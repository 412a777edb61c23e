//! Advice to the user after a failure, the most likely cause first. May be empty.

use sevenbot::ReceiveCounts;
pub(crate) use sevenbot::advice::{exchange, opening};
use sevenbot::servo_bench::ServoError;

pub(crate) const START_SIMULATOR: &str = "`host-sim --link ./7bot` starts a simulated arm that stays, for --port ./7bot; in the source \
                                          tree: `cargo sim -- --link ./7bot`";

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

pub(crate) fn owned(lines: &[&str]) -> Vec<String> {
    lines.iter().map(|&line| line.to_owned()).collect()
}
