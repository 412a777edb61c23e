//! What can be wrong with an arm: the only table of the problems' texts and remedies.
//!
//! The tool, the Python package and the page show these texts. The page has a translation of each row.

use std::fmt;

use protocol_core::registers::Joint;
use protocol_core::registers::map::{fault, servo_alarm};

/// One kind of problem. The variants are in the order of importance, the most important first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ProblemKind {
    /// The controller restarted while a program used the arm.
    Restarted,
    /// The supply of the servos was lost, and the controller keeps the motors off
    /// ([D29](protocol_core::decisions#d29)).
    SupplyLost,
    /// No servo answers, as when the emergency stop is open.
    NoServoAnswers,
    /// The joint's servo does not answer.
    NoAnswer,
    /// A servo reports that its supply is too low or too high.
    Voltage,
    /// The joint's servo holds no torque although it should ([D28](protocol_core::decisions#d28)).
    LetGo,
    /// An obstacle keeps the joint from its target ([D27](protocol_core::decisions#d27)).
    Blocked,
    /// A servo reports that it was overloaded.
    Overload,
    /// A servo reports that it is too hot.
    Overheat,
    /// A servo reports an error, and the firmware does not tell which.
    ServoBus,
    /// The host-link watchdog acted ([D24](protocol_core::decisions#d24)).
    HostSilent,
    /// Settings cannot be stored, or could not be read ([D19](protocol_core::decisions#d19)).
    SettingsStorage,
    /// The controller hung or crashed, and restarted.
    WatchdogRestart,
    /// The controller restarted after a drop of its supply.
    BrownOutRestart,
    /// The controller's crystal failed, so its clock is inexact.
    CrystalFailed,
    /// The controller's receive buffer was full.
    ReceiveOverrun,
}

/// The texts of one kind of problem.
struct ProblemTexts {
    kind: ProblemKind,
    /// For a table: a few words.
    name: &'static str,
    /// A sentence without its full stop. For a joint's problem, the part after "joint 2 ".
    words: &'static str,
    remedy: &'static str,
}

impl ProblemTexts {
    const fn of(kind: ProblemKind, name: &'static str, words: &'static str, remedy: &'static str) -> Self {
        Self { kind, name, words, remedy }
    }
}

/// Names, words and remedies. The names of faults and alarms are also the meanings of registers 241 and 197.
const TABLE: [ProblemTexts; 16] = [
    ProblemTexts::of(
        ProblemKind::Restarted,
        "restarted",
        "the controller restarted and holds the arm where it was",
        "look for the cause (supply, cable, a crash: see the faults), then start the program again",
    ),
    ProblemTexts::of(
        ProblemKind::SupplyLost,
        "supply lost",
        "the servos lost their supply, so the motors stay off",
        "check that nothing is in the arm's way, then switch the motors on (motor state 1): the arm holds where it is",
    ),
    ProblemTexts::of(
        ProblemKind::NoServoAnswers,
        "no servo answers",
        "no servo answers",
        "close the emergency stop, and check the servos' supply and the cable of the servo bus",
    ),
    ProblemTexts::of(
        ProblemKind::NoAnswer,
        "no answer",
        "does not answer: its position is unknown",
        "check the plugs and the cable of its servo; keep clear, the servo may still hold or drive the joint",
    ),
    ProblemTexts::of(
        ProblemKind::Voltage,
        "wrong voltage",
        "the supply of a servo is too low or too high",
        "check the servos' supply: 6 to 8.4 V under load, and its plugs and wires",
    ),
    ProblemTexts::of(
        ProblemKind::LetGo,
        "let go",
        "let go: its servo holds no torque",
        "support the arm and end the cause (load, heat, supply, a loose plug); if it does not hold again by itself, write \
         motor state 1",
    ),
    ProblemTexts::of(
        ProblemKind::Blocked,
        "blocked",
        "is blocked: something keeps it from its target",
        "remove what is in its way, or take weight off; the next target for it tries again (a gripper may hold things with effector type 1)",
    ),
    ProblemTexts::of(
        ProblemKind::Overload,
        "overload",
        "a servo was overloaded and may have switched itself off",
        "take the weight off or remove the obstacle, and let the joint rest; if the alarm stays, write motor state 1",
    ),
    ProblemTexts::of(
        ProblemKind::Overheat,
        "too hot",
        "a servo is too hot",
        "let it cool, which takes minutes: less load, a pose that needs less force, or the motors off with the arm \
         supported",
    ),
    ProblemTexts::of(
        ProblemKind::ServoBus,
        "servo bus",
        "a servo reports an error; this firmware does not tell which",
        "look for overload, heat and a wrong supply; to end an overload, support the arm and write motor state 2, then 1",
    ),
    ProblemTexts::of(
        ProblemKind::HostSilent,
        "host was silent",
        "the program that streamed to the arm fell silent, so the arm's watchdog acted",
        "start the program again: the next stream clears this; `watchdog` 0 (register 186) clears it, too",
    ),
    ProblemTexts::of(
        ProblemKind::SettingsStorage,
        "settings storage",
        "settings cannot be stored, or could not be read",
        "switch the controller off and on; if it stays, save the settings elsewhere: the flash may be worn",
    ),
    ProblemTexts::of(
        ProblemKind::WatchdogRestart,
        "restarted by the watchdog",
        "the controller hung or crashed, and restarted",
        "switch the controller off and on to clear this; please report it with what the arm was doing",
    ),
    ProblemTexts::of(
        ProblemKind::BrownOutRestart,
        "restarted after a drop of the supply",
        "the controller restarted after a drop of its supply",
        "check the controller's supply; switch it off and on to clear this",
    ),
    ProblemTexts::of(
        ProblemKind::CrystalFailed,
        "crystal failed",
        "the controller's crystal failed, so its clock is inexact",
        "the arm works at room temperature at best: have the controller's board repaired",
    ),
    ProblemTexts::of(
        ProblemKind::ReceiveOverrun,
        "over-run of the receive buffer",
        "bytes from the host were lost, because they came too fast",
        "a lower baud rate or fewer frames; switch the controller off and on to clear this",
    ),
];

/// The bits of register 241 and their problems, in ascending order.
pub(crate) const FAULT_BITS: [(u8, ProblemKind); 7] = [
    (fault::SETTINGS_STORAGE, ProblemKind::SettingsStorage),
    (fault::SERVO_BUS, ProblemKind::ServoBus),
    (fault::WATCHDOG_RESTART, ProblemKind::WatchdogRestart),
    (fault::BROWN_OUT_RESTART, ProblemKind::BrownOutRestart),
    (fault::CRYSTAL_FAILED, ProblemKind::CrystalFailed),
    (fault::RECEIVE_OVERRUN, ProblemKind::ReceiveOverrun),
    (fault::HOST_SILENT, ProblemKind::HostSilent),
];

/// The bits of register 197 and their problems, in ascending order.
pub(crate) const ALARM_BITS: [(u8, ProblemKind); 3] = [
    (servo_alarm::VOLTAGE, ProblemKind::Voltage),
    (servo_alarm::OVERHEAT, ProblemKind::Overheat),
    (servo_alarm::OVERLOAD, ProblemKind::Overload),
];

impl ProblemKind {
    /// All kinds, the most important first.
    pub const ALL: [Self; TABLE.len()] = [
        Self::Restarted,
        Self::SupplyLost,
        Self::NoServoAnswers,
        Self::NoAnswer,
        Self::Voltage,
        Self::LetGo,
        Self::Blocked,
        Self::Overload,
        Self::Overheat,
        Self::ServoBus,
        Self::HostSilent,
        Self::SettingsStorage,
        Self::WatchdogRestart,
        Self::BrownOutRestart,
        Self::CrystalFailed,
        Self::ReceiveOverrun,
    ];

    /// A few words, for a table.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.texts().map_or("", |texts| texts.name)
    }

    /// What is wrong. For a joint's problem, the part of the sentence after "joint 2 ".
    #[must_use]
    pub fn words(self) -> &'static str {
        self.texts().map_or("", |texts| texts.words)
    }

    /// What a user can do about it: a sentence without its capital letter and its full stop.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        self.texts().map_or("", |texts| texts.remedy)
    }

    /// Does this problem end moves? A problem of a joint ends the moves of that joint, a problem of the arm ends all moves.
    /// `false` for an alarm, although a new one ends a move after 3 s.
    #[must_use]
    pub const fn ends_moves(self) -> bool {
        matches!(
            self,
            Self::Restarted
                | Self::SupplyLost
                | Self::NoServoAnswers
                | Self::NoAnswer
                | Self::LetGo
                | Self::Blocked
        )
    }

    /// Are positions unknown while the arm, or a joint, has this problem?
    #[must_use]
    pub const fn hides_positions(self) -> bool {
        matches!(self, Self::Restarted | Self::NoServoAnswers | Self::NoAnswer)
    }

    /// Is it an alarm of a servo, which may have switched itself off?
    #[must_use]
    pub const fn is_alarm(self) -> bool {
        matches!(self, Self::Voltage | Self::Overload | Self::Overheat)
    }

    fn texts(self) -> Option<&'static ProblemTexts> {
        TABLE.iter().find(|texts| texts.kind == self)
    }
}

/// Something that is wrong with an arm or one of its joints.
///
/// ```
/// use sevenbot::Joint;
/// use sevenbot::health::{Problem, ProblemKind};
///
/// let blocked = Problem { kind: ProblemKind::Blocked, joint: Joint::new(2) };
/// assert_eq!(blocked.to_string(), "joint 2 is blocked: something keeps it from its target");
/// assert!(blocked.kind.remedy().starts_with("remove what is in its way"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Problem {
    /// What is wrong, with its words and its remedy.
    pub kind: ProblemKind,
    /// The joint; `None`: a problem of the whole arm.
    pub joint: Option<Joint>,
}

impl Problem {
    /// A problem of the whole arm.
    #[must_use]
    pub const fn of_arm(kind: ProblemKind) -> Self {
        Self { kind, joint: None }
    }

    /// A problem of each joint in these bits.
    pub(crate) fn of_joints(kind: ProblemKind, bits: u8) -> impl Iterator<Item = Self> {
        let joints = Joint::ALL.into_iter().filter(move |joint| bits & joint.bit() != 0);
        joints.map(move |joint| Self { kind, joint: Some(joint) })
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.joint {
            Some(joint) => write!(out, "joint {} {}", joint.number(), self.kind.words()),
            None => out.write_str(self.kind.words()),
        }
    }
}

/// The problems as one text, separated by semicolons.
#[must_use]
pub fn sentences(problems: &[Problem]) -> String {
    problems.iter().map(Problem::to_string).collect::<Vec<_>>().join("; ")
}

/// What to do about the problems: one line for each kind, if problems of the same kind stand together.
#[must_use]
pub fn remedies(problems: &[Problem]) -> Vec<&'static str> {
    let mut kinds: Vec<ProblemKind> = problems.iter().map(|problem| problem.kind).collect();
    kinds.dedup();
    kinds.into_iter().map(ProblemKind::remedy).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_texts_in_the_order_of_importance() {
        assert!(ProblemKind::ALL.is_sorted());
        assert_eq!(TABLE.map(|texts| texts.kind), ProblemKind::ALL);
        for kind in ProblemKind::ALL {
            assert!(![kind.name(), kind.words(), kind.remedy()].contains(&""), "{kind:?}");
        }
    }

    #[test]
    fn several_problems_are_one_text_and_a_remedy_for_each_kind() {
        let silent: Vec<_> = Problem::of_joints(ProblemKind::NoAnswer, 0b110).collect();
        let text = sentences(&silent);
        assert!(text.starts_with("joint 2 does not answer") && text.contains("; joint 3 does"), "{text}");
        assert_eq!(remedies(&silent), [ProblemKind::NoAnswer.remedy()]);
    }
}
