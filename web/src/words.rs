//! What the page says of the arm, in one line.

use sevenbot::map::{fault, motor_state};

use crate::arm_state::ArmState;
use crate::stop::StopProgress;
use crate::texts::Language;

/// Is the news good, bad or neither?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mood {
    /// All is well.
    Good,
    /// A person should act.
    Bad,
    /// Neither.
    Plain,
}

impl Mood {
    /// The class of the line on the page.
    #[must_use]
    pub const fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Bad => "bad",
            Self::Plain => "",
        }
    }
}

/// Does an arm answer?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answers {
    /// Not yet.
    NotYet,
    /// It does.
    Yes,
    /// It did.
    NoLonger,
}

/// The line, and its mood: the most important thing first.
#[must_use]
pub fn state_line(
    language: Language,
    answers: Answers,
    state: &ArmState,
    stop: StopProgress,
) -> (String, Mood) {
    let plain = |name| (language.text(name).to_owned(), Mood::Plain);
    let bad = |name| (language.text(name).to_owned(), Mood::Bad);
    match answers {
        Answers::NotYet => return plain("connecting"),
        Answers::NoLonger => return bad("lost"),
        Answers::Yes => {}
    }
    match stop {
        StopProgress::Failed => return bad("stop-failed"),
        StopProgress::Verifying => return plain("stopping"),
        _ => {}
    }
    let named = |name, bits| (format!("{} {}", language.text(name), joints(bits)), Mood::Bad);
    if state.missing != 0 {
        return named("missing", state.missing);
    }
    if state.stalled != 0 {
        return named("stalled", state.stalled);
    }
    if state.faults != 0 {
        return (faults(language, state.faults), Mood::Bad);
    }
    match (stop, state.motor_state) {
        (StopProgress::NotDriven, 0 | 2) => plain("stop-limp"),
        (_, motor_state::DAMPING) => plain("damped"),
        (_, motor_state::FORCELESS) => plain("limp"),
        _ if state.measured.contains(&None) => plain("starting"),
        _ if state.moving != 0 => plain("moving"),
        (StopProgress::Holds, _) => (language.text("holds").to_owned(), Mood::Good),
        _ => (language.text("ready").to_owned(), Mood::Good),
    }
}

/// What a person should know of these bits of register 241.
fn faults(language: Language, bits: u8) -> String {
    const NAMES: [(u8, &str); 7] = [
        (fault::SERVO_BUS, "fault-servo-bus"),
        (fault::HOST_SILENT, "fault-host-silent"),
        (fault::SETTINGS_STORAGE, "fault-settings"),
        (fault::BROWN_OUT_RESTART, "fault-brown-out"),
        (fault::WATCHDOG_RESTART, "fault-watchdog"),
        (fault::CRYSTAL_FAILED, "fault-crystal"),
        (fault::RECEIVE_OVERRUN, "fault-overrun"),
    ];
    let set = NAMES.into_iter().filter(|(bit, _)| bits & bit != 0);
    set.map(|(_, name)| language.text(name)).collect::<Vec<_>>().join(" ")
}

/// The numbers of joints, bit n-1 for joint n.
fn joints(bits: u8) -> String {
    let numbers = (1..=7).filter(|number| bits >> (number - 1) & 1 == 1);
    numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> ArmState {
        let mut registers = sevenbot::Snapshot { address: 0, values: vec![0; 256] };
        registers.values[29] = motor_state::SERVO;
        ArmState::new(&registers)
    }

    #[test]
    fn an_arm_that_measures_its_joints_is_not_ready() {
        let mut starting = state();
        starting.measured[2] = None;
        assert_eq!(said(&starting, StopProgress::None), "The arm starts and measures its joints.");
    }

    fn said(state: &ArmState, stop: StopProgress) -> String {
        state_line(Language::English, Answers::Yes, state, stop).0
    }

    #[test]
    fn the_most_important_thing_is_said() {
        assert_eq!(said(&state(), StopProgress::None), "The arm is ready.");
        assert_eq!(said(&state(), StopProgress::Holds), "Stopped: the arm holds.");
        let moving = ArmState { moving: 1, ..state() };
        assert_eq!(said(&moving, StopProgress::Holds), "The arm is moving.", "it was moved again");
        let missing = ArmState { missing: 0b101, faults: 1, ..moving };
        assert!(said(&missing, StopProgress::None).ends_with("joint 1, 3"));
        assert!(said(&missing, StopProgress::Failed).starts_with("The arm did not take the stop."));
        let overloaded = ArmState { missing: 0, faults: 0b100_0010, ..missing.clone() };
        let line = said(&overloaded, StopProgress::None);
        assert!(line.starts_with("A servo reports") && line.contains("fell silent"), "{line}");
        let stalled = ArmState { stalled: 0b10, ..overloaded };
        assert!(said(&stalled, StopProgress::None).ends_with("then hold: joint 2"));
        let limp = ArmState { motor_state: 2, ..state() };
        assert!(said(&limp, StopProgress::NotDriven).contains("nothing to stop"));
    }

    #[test]
    fn a_silent_arm_is_said_first() {
        let missing = ArmState { missing: 1, ..state() };
        let (line, mood) = state_line(Language::English, Answers::NoLonger, &missing, StopProgress::None);
        assert!(line.starts_with("The arm does not answer") && mood == Mood::Bad);
    }
}
