//! The line that describes the state of the arm, and the messages for failures, in the language of the page.

use block_programs::ProgramFault;
use sevenbot::health::MoveFault;
use sevenbot::map::motor_state;
use sevenbot::{Joint, ProblemKind};

use crate::arm_state::{ArmState, misplaced};
use crate::movement::PlayFailure;
use crate::park::ParkFailure;
use crate::program::ProgramFailure;
use crate::stop::StopProgress;
use crate::texts::Language;

/// At most this many problems are shown at the same time, because the line is short.
const PROBLEMS_SHOWN: usize = 2;

/// The kind of the line's message, which determines the colour of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mood {
    /// All is well.
    Good,
    /// A person has to act.
    Bad,
    /// Neutral: nothing is wrong, but the arm is not ready, for example because it moves.
    Plain,
}

impl Mood {
    /// The CSS class of the line.
    #[must_use]
    pub const fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Bad => "bad",
            Self::Plain => "",
        }
    }
}

/// Whether the arm answers the reads of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answers {
    /// No round of reads has been completed yet.
    NotYet,
    /// It answers, except for at most two rounds of reads in a row.
    Yes,
    /// It answered before, but does not answer now.
    NoLonger,
    /// The connection to it is closed.
    LineEnded,
}

/// The line for a state of the arm, and its mood. If several facts apply, the most important one wins. `doing` is the name of the
/// text that describes what the page does with the arm; `None` if it does nothing.
#[must_use]
pub fn state_line(
    language: Language,
    answers: Answers,
    state: &ArmState,
    (stop, doing): (StopProgress, Option<&'static str>),
) -> (String, Mood) {
    let plain = |name| (language.text(name).to_owned(), Mood::Plain);
    let bad = |name| (language.text(name).to_owned(), Mood::Bad);
    match answers {
        Answers::NotYet => return plain("connecting"),
        Answers::NoLonger => return bad("lost"),
        Answers::LineEnded => return bad("line-ended"),
        Answers::Yes => {}
    }
    match stop {
        StopProgress::Failed => return bad("stop-failed"),
        StopProgress::Verifying => return plain("stopping"),
        _ => {}
    }
    let stalled = || format!("{} {}", language.text("stalled"), joints(state.stalled));
    // A stalled joint tells more than a fault bit that names no joint.
    match state.problems.first() {
        Some(problem) if problem.kind < ProblemKind::ServoBus || state.stalled == 0 => {
            let texts = state.problems.iter().take(PROBLEMS_SHOWN).map(|&problem| language.problem(problem));
            // Some problems last until a restart, and must not hide that a stop was confirmed.
            let confirmation = stop_confirmation(state, stop).map(|name| language.text(name).to_owned());
            return (confirmation.into_iter().chain(texts).collect::<Vec<_>>().join(" "), Mood::Bad);
        }
        _ if state.stalled != 0 => return (stalled(), Mood::Bad),
        _ => {}
    }
    match (stop, state.motor_state) {
        (StopProgress::NotDriven, 0 | 2) => plain("stop-limp"),
        (_, motor_state::DAMPING) => plain("damped"),
        (_, motor_state::FORCELESS) => plain("limp"),
        _ if state.measured.contains(&None) => plain("starting"),
        _ => moving_or_ready(language, state, stop, doing),
    }
}

fn moving_or_ready(
    language: Language,
    state: &ArmState,
    stop: StopProgress,
    doing: Option<&'static str>,
) -> (String, Mood) {
    let moving = (state.moving != 0).then_some("moving");
    if let Some(name) = doing.or(moving) {
        return (language.text(name).to_owned(), Mood::Plain);
    }
    let name = if stop == StopProgress::Holds { "holds" } else { "ready" };
    match misplaced(state.angles()) {
        Some(place) => {
            let [line, part, place] = [name, "a-part-is", place].map(|name| language.text(name));
            (format!("{line} {part} {place}."), Mood::Bad)
        }
        None => (language.text(name).to_owned(), Mood::Good),
    }
}

/// The name of the text that confirms a stop of an arm that has problems. `None` if there was no stop, if the arm moves again, or
/// if a joint of a driven arm may lack the torque to hold.
fn stop_confirmation(state: &ArmState, stop: StopProgress) -> Option<&'static str> {
    let is_without_torque = state.problems.iter().any(|problem| {
        use ProblemKind::{LetGo, NoAnswer, NoServoAnswers, SupplyLost};
        matches!(problem.kind, SupplyLost | NoServoAnswers | NoAnswer | LetGo)
    });
    match (stop, state.motor_state) {
        (StopProgress::NotDriven, motor_state::DAMPING | motor_state::FORCELESS) => Some("stop-limp"),
        (StopProgress::Holds, motor_state::SERVO) if state.moving == 0 && !is_without_torque => Some("holds"),
        _ => None,
    }
}

/// The message for a movement that ended early.
#[must_use]
pub fn play_failure(language: Language, failure: &PlayFailure) -> String {
    format!("{} {}", language.text("play-failed"), play_reason(language, failure))
}

fn play_reason(language: Language, failure: &PlayFailure) -> String {
    match failure {
        PlayFailure::Arm(fault) => move_fault(language, fault),
        PlayFailure::Paused(_) => language.text("paused").to_owned(),
        PlayFailure::NotTaken => language.text("not-taken").to_owned(),
        PlayFailure::StoppedByAnother => language.text("stopped-by-another").to_owned(),
        PlayFailure::NotReached(away) => {
            format!("{} {}", language.text("not-reached"), numbers(away.iter().map(|(joint, ..)| *joint)))
        }
    }
}

/// The message for a failed park.
#[must_use]
pub fn park_failure(language: Language, failure: &ParkFailure) -> String {
    let reason = match failure {
        ParkFailure::NotMeasured => language.text("starting").to_owned(),
        ParkFailure::Sank => language.text("park-sank").to_owned(),
        ParkFailure::Move(failure) => play_reason(language, failure),
    };
    format!("{} {reason}", language.text("park-failed"))
}

/// The message for a program of blocks that ended early.
#[must_use]
pub fn program_failure(language: Language, failure: &ProgramFailure) -> String {
    format!("{} {}", language.text("program-failed"), program_reason(language, failure))
}

/// The message for a preview in which the program ended early.
#[must_use]
pub fn preview_failure(language: Language, failure: &ProgramFailure) -> String {
    format!("{} {}", language.text("preview-failed"), program_reason(language, failure))
}

fn program_reason(language: Language, failure: &ProgramFailure) -> String {
    match failure {
        ProgramFailure::Program(error) => program_fault(language, &error.fault),
        ProgramFailure::Arm(failure) => play_reason(language, failure),
        ProgramFailure::Refused { details, .. } if language == Language::English => format!("{details}."),
        ProgramFailure::Refused { text, .. } => {
            format!("{} {}", language.text("way-refused"), language.text(text))
        }
        ProgramFailure::NotTold => language.text("not-told").to_owned(),
        ProgramFailure::OtherTargets(joints) => {
            format!("{} {}", language.text("other-targets"), numbers(joints.iter().copied()))
        }
    }
}

/// The message for a fault in a program of blocks.
#[must_use]
pub fn program_fault(language: Language, fault: &ProgramFault) -> String {
    if language == Language::English {
        return format!("{fault}.");
    }
    let text = |name| language.text(name);
    match fault {
        ProgramFault::NotAWorkspace(_) | ProgramFault::TooLarge | ProgramFault::TooDeep => {
            text("no-program").to_owned()
        }
        ProgramFault::NoStart | ProgramFault::SeveralStarts => text("one-start").to_owned(),
        ProgramFault::UnknownBlock(kind) => format!("{} {kind}", text("unknown-block")),
        ProgramFault::EmptyInput(input) => format!("{} {input}", text("empty-input")),
        ProgramFault::BadField(field) => format!("{} {field}", text("bad-field")),
        ProgramFault::UnknownFunction(name) => format!("{} {name}", text("unknown-function")),
        ProgramFault::NotInLoop | ProgramFault::NotInFunction => text("not-inside").to_owned(),
        ProgramFault::NoNumber => text("no-result").to_owned(),
        ProgramFault::TooManyCalls => text("too-many-calls").to_owned(),
        ProgramFault::OutOfRange { quantity, value, lowest, highest } => {
            format!("{} {value}: {lowest} – {highest} {}", text("number-range"), quantity.unit())
        }
    }
}

/// The numbers of these joints as a list.
fn numbers(joints: impl Iterator<Item = Joint>) -> String {
    joints.map(|joint| joint.number().to_string()).collect::<Vec<_>>().join(", ")
}

/// The message for a recording that ended early.
#[must_use]
pub fn recording_failure(language: Language, fault: &MoveFault) -> String {
    format!("{} {}", language.text("record-failed"), move_fault(language, fault))
}

fn move_fault(language: Language, fault: &MoveFault) -> String {
    match fault {
        MoveFault::Problems(problems) => {
            let texts = problems.iter().take(PROBLEMS_SHOWN).map(|&problem| language.problem(problem));
            texts.collect::<Vec<_>>().join(" ")
        }
        MoveFault::NotDriven { .. } => language.text("motors-are-off").to_owned(),
        MoveFault::Silent => language.text("lost").to_owned(),
        MoveFault::StoppedByAnother => language.text("stopped-by-another").to_owned(),
    }
}

/// The numbers of the joints whose bits are set (bit n-1 for joint n), as a list.
fn joints(bits: u8) -> String {
    let numbers = (1..=7).filter(|number| bits >> (number - 1) & 1 == 1);
    numbers.map(|number| number.to_string()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The state of an arm without problems, with these registers changed.
    fn with(registers: &[(u8, u8)]) -> ArmState {
        let mut all = sevenbot::Snapshot { address: 0, values: vec![0; 256] };
        // Joints 2 and 3 are within the limits of their linkage.
        let well = [(29, motor_state::SERVO), (47, 115), (48, 65), (55, 115), (56, 65), (199, 1), (240, 1)];
        for &(address, value) in well.iter().chain(registers) {
            all.values[usize::from(address)] = value;
        }
        ArmState::new(&all)
    }

    fn state() -> ArmState {
        with(&[])
    }

    #[test]
    fn an_arm_that_measures_its_joints_is_not_ready() {
        let mut starting = state();
        starting.measured[2] = None;
        assert_eq!(said(&starting, StopProgress::None), "The arm starts and measures its joints.");
    }

    fn said(state: &ArmState, stop: StopProgress) -> String {
        state_line(Language::English, Answers::Yes, state, (stop, None)).0
    }

    #[test]
    fn the_most_important_thing_is_said() {
        assert_eq!(said(&state(), StopProgress::None), "The arm is ready.");
        assert_eq!(said(&state(), StopProgress::Holds), "Stopped: the arm holds.");
        let folded = with(&[(47, 10), (55, 10)]);
        assert!(
            said(&folded, StopProgress::None).contains("beyond what the linkage"),
            "65 - 65 + 10 is below 19"
        );
        let moving = ArmState { moving: 1, ..state() };
        assert_eq!(said(&moving, StopProgress::Holds), "The arm is moving.", "it was moved again");
        let missing = with(&[(242, 0b101), (241, 1), (243, 1)]);
        let line = said(&missing, StopProgress::None);
        assert!(line.starts_with("Joint 1 does not answer") && line.contains("Joint 3 does not"), "{line}");
        assert!(said(&missing, StopProgress::Failed).starts_with("The arm did not take the stop."));
        let overloaded = with(&[(241, 0b100_0010)]);
        let line = said(&overloaded, StopProgress::None);
        assert!(line.starts_with("A servo reports an error") && line.contains("fell silent"), "{line}");
        let stalled = ArmState { stalled: 0b10, ..overloaded };
        assert!(said(&stalled, StopProgress::None).ends_with("then hold: joint 2"));
        let blocked = with(&[(195, 0b10), (196, 0b100), (197, 0b100)]);
        let line = said(&blocked, StopProgress::None);
        assert!(line.starts_with("Joint 3 let go") && line.contains("Joint 2 is blocked"), "{line}");
        let supply = with(&[(198, 1), (29, 0)]);
        assert!(said(&supply, StopProgress::None).starts_with("The servos lost their supply"));
        let limp = ArmState { motor_state: 2, ..state() };
        assert!(said(&limp, StopProgress::NotDriven).contains("nothing to stop"));
    }

    #[test]
    fn a_fault_that_stays_does_not_hide_a_stop() {
        let restarted = with(&[(241, 0b1000)]);
        let fault = said(&restarted, StopProgress::None);
        assert!(!fault.is_empty() && !fault.contains("Stopped"), "{fault}");
        assert_eq!(said(&restarted, StopProgress::Holds), format!("Stopped: the arm holds. {fault}"));
        let moving = ArmState { moving: 1, ..restarted.clone() };
        assert_eq!(said(&moving, StopProgress::Holds), fault, "it was moved again");
        let limp = ArmState { motor_state: motor_state::FORCELESS, ..restarted };
        assert!(
            said(&limp, StopProgress::NotDriven).starts_with("The motors are off: there is nothing to stop.")
        );
        let silent = said(&with(&[(242, 1), (241, 2), (243, 0)]), StopProgress::Holds);
        assert!(
            silent.starts_with("Joint 1 does not answer"),
            "a joint without an answer may not hold: {silent}"
        );
    }

    #[test]
    fn a_movement_that_ends_early_is_told_with_its_reason() {
        let silent = sevenbot::Problem { kind: ProblemKind::NoAnswer, joint: sevenbot::Joint::new(3) };
        let silent = PlayFailure::Arm(MoveFault::Problems(vec![silent]));
        let text = play_failure(Language::English, &silent);
        assert!(text.starts_with("The movement ended early. Joint 3 does not answer"), "{text}");
        let away =
            PlayFailure::NotReached(sevenbot::Joint::ALL[..2].iter().map(|&joint| (joint, 1, 9)).collect());
        assert!(play_failure(Language::English, &away).ends_with("what holds them: 1, 2"));
    }

    #[test]
    fn a_silent_arm_is_said_first() {
        let missing = with(&[(242, 1)]);
        let (line, mood) =
            state_line(Language::English, Answers::NoLonger, &missing, (StopProgress::None, None));
        assert!(line.starts_with("The arm does not answer") && mood == Mood::Bad);
    }
}
