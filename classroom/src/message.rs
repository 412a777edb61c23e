//! The messages of a class, as JSON. What a pupil sends has bounded types: nothing of it reaches the teacher unread.

use serde::{Deserialize, Serialize};

/// The points of the arm in a [`Report`]: shoulder, elbow, begin of the forearm, wrist, tip.
pub const POINTS: usize = 5;
/// The longest message of the teacher to all, in characters.
pub const LONGEST_TEXT: usize = 280;

/// What a pupil's tab sends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FromPupil {
    /// The first message: who it is.
    Join {
        /// The name that the pupil typed.
        name: String,
        /// The key of [`ToPupil::Welcome`], if the tab was in the class before.
        key: Option<String>,
    },
    /// The answer to [`ToPupil::Ask`].
    Report(Report),
    /// The answer to [`ToPupil::Stop`], once the arm of the tab has confirmed it.
    Stopped {
        /// The number of the stop.
        number: u32,
        /// What the arm does now.
        outcome: StopOutcome,
    },
    /// Stops the class's real arm, whoever has it.
    StopArm,
}

impl FromPupil {
    /// The message in JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Structures of text and numbers always become JSON.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// What the arm of a tab does.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// x, y, z in mm, see [`POINTS`]; `None` while the arm is not measured.
    pub points: Option<[[i16; 3]; POINTS]>,
    /// In a word.
    pub doing: Doing,
    /// The exercise that was begun.
    pub goals: Option<Goals>,
    /// The tab is in the background: a simulated arm stands still there.
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
    /// It moves.
    Moving,
    /// A program of blocks runs.
    Program,
    /// A recorded movement is played.
    Playing,
    /// It is being parked.
    Parking,
    /// A stop is on its way.
    Stopping,
    /// A stop has been confirmed, and nothing moved it since.
    Stopped,
    /// It did not take a stop.
    StopFailed,
    /// Its motors are off or damped.
    Limp,
    /// A joint is held back by something.
    Blocked,
    /// Something else is wrong.
    Problem,
}

/// The goals of an exercise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Goals {
    /// How many are reached.
    pub reached: u8,
    /// How many there are.
    pub all: u8,
}

/// How a stop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopOutcome {
    /// The arm holds.
    Holds,
    /// The motors are off: there is nothing to stop.
    Limp,
}

/// What a pupil's tab gets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ToPupil {
    /// The tab is in the class.
    Welcome {
        /// The name in the class. It differs from the wanted one if another pupil has that.
        name: String,
        /// A secret of this tab: it keeps its place with it, and reaches the real arm while it has it.
        key: String,
    },
    /// The tab is not in the class. The server closes the connection.
    Refused(Refusal),
    /// Stop the arm of this tab, before everything else. It comes again until [`FromPupil::Stopped`].
    Stop {
        /// Which stop.
        number: u32,
    },
    /// A message of the teacher; an empty one takes the last one back.
    Message {
        /// The text.
        text: String,
    },
    /// How does the arm do? Answered by [`FromPupil::Report`].
    Ask {
        /// Who has the real arm.
        arm: Option<LentArm>,
        /// This tab had the real arm before this message, and has it no longer.
        over: Option<LeaseEnd>,
    },
}

/// Why a tab is not in the class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// There is no letter or digit in the name.
    NoName,
    /// There are too many pupils.
    Full,
    /// The same pupil has joined in another tab.
    OtherTab,
    /// A message was none of these.
    BadMessage,
}

/// The real arm, while a pupil has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LentArm {
    /// Who has it.
    pub holder: String,
    /// For how long from now, in seconds.
    pub seconds: u32,
    /// The tab that gets this message has it.
    pub is_yours: bool,
}

/// Why a pupil has the real arm no longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LeaseEnd {
    /// The time is over.
    Time,
    /// The teacher took it back, or gave it to another pupil.
    TakenBack,
    /// The connection of the tab was lost.
    Lost,
}

/// What the teacher's screen sends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FromTeacher {
    /// All arms stop.
    StopAll,
    /// A message to all; an empty one takes the last one back.
    Say {
        /// The text, cut after [`LONGEST_TEXT`] characters.
        text: String,
    },
    /// Gives the real arm to a pupil. Who has it loses it.
    Give {
        /// The number of the pupil.
        pupil: u32,
        /// For how long: 1 to 3600 s.
        seconds: u32,
    },
    /// Takes the real arm back.
    TakeBack,
}

/// What the teacher's screen gets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToTeacher {
    /// The first message.
    Welcome {
        /// The addresses that pupils open.
        addresses: Vec<String>,
        /// What they have to type, if something.
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
    /// The pupil is not connected.
    PupilGone,
    /// Not 1 to 3600 s.
    BadTime,
}

/// The class.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClassNews {
    /// In the order in which they joined.
    pub pupils: Vec<Tile>,
    /// The last stop for all.
    pub stop: Option<StopNews>,
    /// The real arm; `None` if the class has none.
    pub arm: Option<ArmTile>,
    /// The message that all see.
    pub text: String,
}

/// A pupil on the teacher's screen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tile {
    /// The number of the pupil.
    pub pupil: u32,
    /// To be shown as text.
    pub name: String,
    /// Is the tab connected, and does it answer?
    pub presence: Presence,
    /// What its arm did last.
    pub report: Option<Report>,
    /// What the tab says of the last stop for all; `None` if it was not asked.
    pub stop: Option<TileStop>,
}

/// Is a tab there?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Presence {
    /// It answers.
    Here,
    /// It is connected, and has not answered for 8 s.
    Silent,
    /// The connection has ended.
    Lost,
}

/// What a tab, or the real arm, says of the last stop for all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TileStop {
    /// It has not confirmed yet.
    Asked,
    /// The arm holds.
    Holds,
    /// The motors are off.
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

/// How far the last stop for all has come. The real arm counts as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StopNews {
    /// Which stop.
    pub number: u32,
    /// How many arms were to stop.
    pub asked: usize,
    /// How many have confirmed it.
    pub confirmed: usize,
    /// From the teacher's message to the last confirmation so far, in milliseconds.
    pub millis: u64,
}

/// The real arm on the teacher's screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArmTile {
    /// Does it answer?
    pub answers: bool,
    /// What it did with the last stop for all, or at the end of the last lease.
    pub stop: Option<TileStop>,
    /// The pupil who has it.
    pub holder: Option<u32>,
    /// For how long from now, in seconds; 0 if nobody has it.
    pub seconds: u32,
}
