//! The messages of a class, as JSON. The class parses a pupil's messages before it passes their content to the teacher: the types
//! of a report bound its size, and [`crate::name::clean`] bounds names.

use serde::{Deserialize, Serialize};

/// The number of points of the arm in a [`TabReport`]: shoulder, elbow, start of the forearm, wrist, tip.
pub const POINTS: usize = 5;
/// The longest message of the teacher to all, in characters.
pub const LONGEST_TEXT: usize = 280;

/// A message from a pupil's tab.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FromPupil {
    /// The first message: the tab asks to join the class.
    Join {
        /// The name that the pupil typed.
        name: String,
        /// The key of [`ToPupil::Welcome`], if the tab was in the class before.
        key: Option<String>,
    },
    /// The answer to [`ToPupil::Ask`].
    Report(TabReport),
    /// The answer to [`ToPupil::Stop`], once the arm of the tab has confirmed it.
    Stopped {
        /// The number in [`ToPupil::Stop`].
        number: u32,
        /// What the arm does now.
        outcome: StopOutcome,
    },
    /// Stops the class's real arm, whoever has it.
    StopArm,
}

impl FromPupil {
    /// The message in JSON, as [`Classroom::receive`](crate::Classroom::receive) takes it.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Structures of text and numbers always become JSON.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// What the arm of a tab does.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TabReport {
    /// x, y, z in mm, see [`POINTS`]; `None` while the arm is not measured.
    pub points: Option<[[i16; 3]; POINTS]>,
    /// What it does, for the teacher's screen.
    pub doing: Doing,
    /// The goals of the exercise in progress; `None` without an exercise.
    pub goals: Option<ExerciseProgress>,
    /// True if the tab is in the background, where a simulated arm stands still.
    pub is_hidden: bool,
}

/// What an arm does, in a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Doing {
    /// No arm answers.
    NoArm,
    /// It holds, and waits for a person.
    Ready,
    /// It moves, and none of the next three states is the reason.
    Moving,
    /// A program of blocks runs.
    Program,
    /// A recorded movement is played.
    Playing,
    /// It is being parked: moved to its park pose, and let go there.
    Parking,
    /// A stop was sent and is not confirmed yet.
    Stopping,
    /// A stop has been confirmed, and nothing moved it since.
    Stopped,
    /// It did not confirm a stop.
    StopFailed,
    /// Its motors are off or damped.
    Limp,
    /// A joint does not reach its target: something blocks it, or its servo has let go.
    Blocked,
    /// Something else is wrong.
    Problem,
}

/// The progress in an exercise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExerciseProgress {
    /// The number of goals that are reached.
    pub reached: u8,
    /// The number of goals that the exercise has.
    pub all: u8,
}

/// The state of an arm that has confirmed a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopOutcome {
    /// The motors are on, and the arm holds its position.
    Holds,
    /// The motors are off or damped: there is nothing to stop.
    Limp,
}

/// A message to a pupil's tab.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ToPupil {
    /// The tab is in the class.
    Welcome {
        /// The name in the class: the requested name after [`crate::name::clean`], with a number if another pupil has this
        /// name.
        name: String,
        /// A secret of this tab. With it the tab keeps its place in the class, and reaches the real arm during its lease.
        key: String,
    },
    /// The tab is not in the class. The server closes the connection.
    Refused(Refusal),
    /// Stop the arm of this tab, before everything else. The class repeats this message until [`FromPupil::Stopped`].
    Stop {
        /// Counts the stops for all, from 1. [`FromPupil::Stopped`] repeats it.
        number: u32,
    },
    /// A message of the teacher; an empty text removes the last message.
    Message {
        /// The text, at most [`LONGEST_TEXT`] characters.
        text: String,
    },
    /// Asks for a [`FromPupil::Report`], and tells who has the real arm.
    Ask {
        /// The lease of the real arm; `None` if no pupil has it.
        arm: Option<LentArm>,
        /// Why the lease of this tab ended; `None` unless it has ended since the last question.
        over: Option<LeaseEnd>,
    },
}

/// Why a tab is not in the class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// There is no letter or digit in the name.
    NoName,
    /// [`MOST_PUPILS`](crate::MOST_PUPILS) tabs are connected already.
    Full,
    /// The same pupil has joined over a newer connection, for example in another tab.
    OtherTab,
    /// A message was not valid, or the tab did not join within 10 s.
    BadMessage,
}

/// The real arm, while a pupil has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LentArm {
    /// The name of the pupil who has it.
    pub holder: String,
    /// The remaining time in seconds.
    pub seconds: u32,
    /// True if the tab that gets this message has it.
    pub is_yours: bool,
}

/// Why the lease of a pupil ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeaseEnd {
    /// The time of the lease is over.
    Time,
    /// The teacher took it back, or began a new lease.
    TakenBack,
    /// The connection of the tab ended, the tab did not answer for 8 s, or the pupil joined over a newer connection.
    Lost,
}

/// A message from a teacher's screen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FromTeacher {
    /// Stops the arms of all pupils, and the real arm.
    StopAll,
    /// A message to all; an empty text removes the last message.
    Say {
        /// The text, cut after [`LONGEST_TEXT`] characters.
        text: String,
    },
    /// Gives the real arm to a pupil. Another pupil who has it loses it.
    Give {
        /// The pupil, by [`Tile::pupil`].
        pupil: u32,
        /// The time of the lease: 1 to 3600 s.
        seconds: u32,
    },
    /// Takes the real arm back.
    TakeBack,
}

/// A message to a teacher's screen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToTeacher {
    /// The first message.
    Welcome {
        /// The addresses that pupils open.
        addresses: Vec<String>,
        /// The code that pupils have to type; `None` if there is none.
        code: Option<String>,
        /// Does the class have a real arm?
        has_arm: bool,
    },
    /// The class as it is now.
    Class(ClassNews),
    /// The real arm was not given.
    NotGiven(NotGiven),
    /// There are too many teacher's screens. The server closes the connection.
    Full,
}

/// Why the real arm was not given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NotGiven {
    /// The class has none.
    NoArm,
    /// It does not answer.
    ArmSilent,
    /// The pupil is not connected, or has not answered for 8 s.
    PupilGone,
    /// The time is not 1 to 3600 s.
    BadTime,
}

/// The state of the class. Every teacher's screen gets it each 100 to 500 ms.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClassNews {
    /// The pupils, in the order in which they joined.
    pub pupils: Vec<Tile>,
    /// The last stop for all; `None` before the first.
    pub stop: Option<StopNews>,
    /// The real arm; `None` if the class has none.
    pub arm: Option<ArmTile>,
    /// The message that all see.
    pub text: String,
}

/// A pupil on the teacher's screen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tile {
    /// The number of the pupil, from 1. A later pupil of the class has another one.
    pub pupil: u32,
    /// The name of the pupil. Show it as text, not as HTML.
    pub name: String,
    /// Is the tab connected, and does it answer?
    pub presence: TabPresence,
    /// The last report of the tab; `None` before the first.
    pub report: Option<TabReport>,
    /// The state of the last stop for all in this tab; `None` if the tab was not asked.
    pub stop: Option<TileStop>,
}

/// Whether a tab is connected and answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TabPresence {
    /// It is connected, and has joined or answered within the last 8 s.
    Here,
    /// It is connected, and has not answered for 8 s.
    Silent,
    /// The connection has ended.
    Lost,
}

/// The state of a stop in one tab, or at the real arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TileStop {
    /// The stop is not confirmed yet.
    Asked,
    /// The stop is confirmed: the motors were on, and the arm held its position.
    Holds,
    /// The stop is confirmed: the motors were off or damped.
    Limp,
}

impl From<StopOutcome> for TileStop {
    fn from(outcome: StopOutcome) -> Self {
        match outcome {
            StopOutcome::Holds => Self::Holds,
            StopOutcome::Limp => Self::Limp,
        }
    }
}

/// The progress of the last stop for all. The real arm counts as one arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StopNews {
    /// The number of the stop, as in [`ToPupil::Stop`].
    pub number: u32,
    /// The number of arms that were asked to stop, without those of pupils who are no longer in the class.
    pub asked: usize,
    /// The number of arms that have confirmed it.
    pub confirmed: usize,
    /// The time from the teacher's message to the last confirmation so far, in milliseconds.
    pub millis: u64,
}

/// The real arm on the teacher's screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArmTile {
    /// Does it answer? If not, it cannot be given to a pupil.
    pub answers: bool,
    /// Whether it has confirmed the last hold: after a stop for all, a stop by a pupil, or the end of a lease. `None`
    /// before the first hold.
    pub stop: Option<TileStop>,
    /// The number of the pupil who has it; `None` without a lease.
    pub holder: Option<u32>,
    /// The remaining time of the lease in seconds; 0 without a lease.
    pub seconds: u32,
}
