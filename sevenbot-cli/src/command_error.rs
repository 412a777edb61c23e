//! Why a command fails: message, advice and exit status.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::json;
use sevenbot::approach::StartTooFar;
use sevenbot::checked_write::{NotTaken, WriteError};
use sevenbot::health::{MoveCheckError, Problem, ProblemKind, remedies, sentences};
use sevenbot::moves::{ConnectionLost, LineStartError, MoveError};
use sevenbot::register_text::motor_state_name;
use sevenbot::servo_bench::ServoError;
use sevenbot::stream::StreamError;
use sevenbot::{Error, OpenError};

use crate::advice::{self, START_SIMULATOR, owned};
use crate::style::BAD;

/// The exit status of a command that Ctrl-C interrupted: 128 plus the number of SIGINT, as in shells.
pub(crate) const INTERRUPTED: u8 = 130;

/// Advice if the arm may be moving.
const SAFETY: [&str; 3] = [
    "if a person or an object is in its way, switch off the supply of the servos; the arm then falls",
    "is the cable plugged in at both ends, and the baud rate right (--baud)?",
    "then send a stop: `sevenbot stop`",
];

#[derive(Debug)]
pub(crate) enum CommandError {
    /// A failure without advice of its own, such as a request that the arm did not carry out.
    Arm(String),
    /// Registers did not take their values.
    NotTaken(NotTaken),
    /// The arm does not carry out the command, for these reasons, or `info` found them.
    Problems(Vec<Problem>),
    /// The arm may be moving, because this write failed.
    MayMove(WriteError),
    /// The arguments are invalid, an answer from the user is missing, or this program was built without the page.
    Usage(String),
    /// No port was given, and none leads to an arm. `tried` holds each port with the reason.
    NoArm { tried: Vec<(String, OpenError)> },
    /// No port was given, and several lead to an arm.
    SeveralArms { ports: Vec<String> },
    /// The port cannot be opened, or does not lead to an arm.
    Open { port: String, error: OpenError },
    /// The port opens, but no arm answers at any baud rate.
    NoRate { port: String },
    /// An exchange with the arm failed.
    Exchange(Error),
    /// An exchange with a servo failed.
    Servo { port: String, error: ServoError },
    /// No servo answers at the rates and ids of the scan.
    NoServo { port: String, has_echo: bool },
    /// The port leads to an arm's controller, not to servos.
    HostLink { port: String },
    /// A failure with advice of its own.
    WithAdvice { message: String, advice: &'static [&'static str] },
    /// The simulator is not found, is not the only one, or does not answer.
    #[cfg(unix)]
    NoSimulator { message: String, advice: Vec<String> },
    /// The simulator refused the request.
    #[cfg(unix)]
    SimulatorRefused { message: String, hint: String },
    /// A file cannot be read or written, or has the wrong content.
    File { path: PathBuf, reason: String },
    /// The output cannot be written.
    Output(io::Error),
    /// The user interrupted the command.
    Interrupted,
}

impl From<Error> for CommandError {
    fn from(error: Error) -> Self {
        Self::Exchange(error)
    }
}

impl From<WriteError> for CommandError {
    fn from(error: WriteError) -> Self {
        MoveError::from(error).into()
    }
}

impl From<StreamError> for CommandError {
    fn from(error: StreamError) -> Self {
        match error {
            StreamError::Exchange(error) => Self::Exchange(error),
            other => Self::Arm(other.to_string()),
        }
    }
}

impl From<MoveCheckError> for CommandError {
    fn from(error: MoveCheckError) -> Self {
        MoveError::from(error).into()
    }
}

impl From<MoveError> for CommandError {
    fn from(error: MoveError) -> Self {
        match error {
            MoveError::Interrupted => Self::Interrupted,
            MoveError::Exchange(error) => Self::Exchange(error),
            MoveError::Stream(error) => error.into(),
            MoveError::MayMove(reason) => Self::MayMove(reason),
            MoveError::NotTaken(not_taken) => Self::NotTaken(not_taken),
            MoveError::StartTooFar(far) => too_far(&far),
            MoveError::Problems(problems) => Self::Problems(problems),
            MoveError::NotDriven { state } => Self::Arm(format!(
                "the arm's motors are in state {state}, {}: use `sevenbot state servo` first",
                motor_state_name(state)
            )),
            not_reached @ MoveError::NotReached { .. } => Self::WithAdvice {
                message: not_reached.to_string(),
                advice: &[
                    "is something in the way of the joint, or its load too heavy? `sevenbot status` names blocked joints",
                    "did an earlier move still turn it? `sevenbot stop`, then try again",
                ],
            },
            other => Self::Arm(other.to_string()),
        }
    }
}

/// The error for a first point too far from where the arm stands, with advice.
fn too_far(far: &StartTooFar) -> CommandError {
    CommandError::WithAdvice {
        message: format!("{far}. The arm was not sent there"),
        advice: &[
            "--approach SECONDS goes there smoothly first: look that the way is free",
            "or move the arm there yourself: `sevenbot pose A1 A2 A3 A4 A5 A6 A7 --speed 10 --wait`, or `sevenbot home`",
        ],
    }
}

impl ConnectionLost for CommandError {
    fn is_connection_lost(&self) -> bool {
        matches!(self, Self::Exchange(_) | Self::MayMove(_))
    }
}

impl From<LineStartError> for CommandError {
    fn from(error: LineStartError) -> Self {
        match error {
            LineStartError::Exchange(error) => Self::Exchange(error),
            unknown @ LineStartError::Unknown { .. } => Self::Arm(unknown.to_string()),
        }
    }
}

impl From<io::Error> for CommandError {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

impl CommandError {
    pub(crate) fn file(path: &Path, reason: impl ToString) -> Self {
        Self::File { path: path.to_owned(), reason: reason.to_string() }
    }

    /// The exit status; `sevenbot --help` lists them.
    pub(crate) fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.status())
    }

    fn status(&self) -> u8 {
        match self {
            // The reader of the pipe, such as `head`, has ended.
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => 0,
            Self::Arm(_) | Self::NotTaken(_) | Self::Problems(_) | Self::MayMove(_) => 1,
            Self::File { .. } | Self::Output(_) => 1,
            Self::Usage(_) => 2,
            Self::NoArm { .. } | Self::SeveralArms { .. } => 3,
            Self::Open { .. } | Self::NoRate { .. } | Self::Exchange(_) => 3,
            Self::Servo { error: ServoError::NotTaken { .. }, .. } | Self::WithAdvice { .. } => 1,
            #[cfg(unix)]
            Self::NoSimulator { .. } => 3,
            #[cfg(unix)]
            Self::SimulatorRefused { .. } => 1,
            Self::Servo { .. } | Self::NoServo { .. } | Self::HostLink { .. } => 3,
            Self::Interrupted => INTERRUPTED,
        }
    }

    /// Prints message and advice, as text or as JSON. A failure to print does not change the exit status.
    pub(crate) fn report(&self, err: &mut impl Write, is_json: bool) {
        let Some(message) = self.message() else { return };
        if is_json {
            let error = json!({ "error": message, "advice": self.advice(), "status": self.status() });
            let _ = writeln!(err, "{error}");
            return;
        }
        let _ = writeln!(err, "{BAD}error:{BAD:#} {message}");
        for line in self.advice() {
            let _ = writeln!(err, "  - {line}");
        }
    }

    /// The message; `None` for a closed pipe, which is not reported.
    pub(crate) fn message(&self) -> Option<String> {
        match self {
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => None,
            Self::Output(error) => Some(format!("cannot write the output: {error}")),
            Self::Arm(message) | Self::Usage(message) => Some(message.clone()),
            Self::NotTaken(not_taken) => Some(not_taken.to_string()),
            Self::Problems(problems) => Some(sentences(problems)),
            Self::MayMove(reason) => Some(format!("the arm may still be moving: {reason}")),
            Self::NoArm { tried } if tried.is_empty() => {
                Some("no port was given, and this machine has no serial port".to_owned())
            }
            Self::NoArm { .. } => {
                Some("no port was given, and no serial port of this machine leads to an arm".to_owned())
            }
            Self::SeveralArms { ports } => {
                Some(format!("no port was given, and several lead to an arm: {}", ports.join(", ")))
            }
            Self::Open { port, error } => Some(format!("{port}: {error}")),
            Self::NoRate { port } => Some(format!("{port}: no arm answers at any baud rate")),
            Self::Exchange(error) => Some(error.to_string()),
            Self::Servo { port, error } => Some(format!("{port}: {error}")),
            Self::NoServo { port, .. } => Some(format!("{port}: no servo answers")),
            Self::HostLink { port } => Some(format!(
                "{port}: this is the arm's host link: its controller answers here, not its servos"
            )),
            Self::WithAdvice { message, .. } => Some(message.clone()),
            #[cfg(unix)]
            Self::NoSimulator { message, .. } | Self::SimulatorRefused { message, .. } => {
                Some(message.clone())
            }
            Self::File { path, reason } => Some(format!("{}: {reason}", path.display())),
            Self::Interrupted => Some("interrupted".to_owned()),
        }
    }

    fn advice(&self) -> Vec<String> {
        let say_which = "use --port PORT or set SEVENBOT_PORT";
        match self {
            Self::NoArm { tried } => {
                let tried = tried.iter().map(|(port, reason)| format!("{port}: {reason}"));
                let inside = "--port sim is a simulated arm inside this command";
                tried.chain([say_which, inside, START_SIMULATOR].map(str::to_owned)).collect()
            }
            Self::SeveralArms { .. } => vec![say_which.to_owned()],
            Self::NoRate { .. } => {
                ["has the arm power, and is its cable plugged in at both ends?", "is this the right port?"]
                    .map(str::to_owned)
                    .to_vec()
            }
            Self::Problems(problems) => problem_advice(problems),
            Self::MayMove(_) => SAFETY.map(str::to_owned).to_vec(),
            Self::Open { port, error } => advice::opening(port, error),
            Self::Exchange(error) => owned(advice::exchange(error)),
            Self::Servo { error, .. } => owned(advice::servo(error)),
            Self::WithAdvice { advice, .. } => owned(advice),
            #[cfg(unix)]
            Self::NoSimulator { advice, .. } => advice.clone(),
            #[cfg(unix)]
            Self::SimulatorRefused { hint, .. } => vec![hint.clone()],
            Self::HostLink { .. } => {
                owned(&["use an adapter on the servo bus, and take the arm's controller off that bus"])
            }
            Self::NoServo { has_echo, .. } => no_servo(*has_echo),
            _ => Vec::new(),
        }
    }
}

/// What to do about the problems of an arm.
fn problem_advice(problems: &[Problem]) -> Vec<String> {
    let remedies = remedies(problems).into_iter().map(str::to_owned);
    let is_recoverable = |problem: &Problem| problem.kind != ProblemKind::Blocked;
    let recover = problems.iter().any(is_recoverable).then_some("`sevenbot recover` goes through the steps");
    remedies.chain(recover.map(str::to_owned)).collect()
}

/// Advice if no servo answers.
fn no_servo(has_echo: bool) -> Vec<String> {
    let echo: &[&str] = if has_echo { &["the adapter works: it echoes what is sent"] } else { &[] };
    let checks = [
        "do the servos have their own power? The adapter does not supply them",
        "is the signal wire on the adapter's servo side, and the ground common to both?",
        "without --rates and --ids a scan tries all rates and ids",
        "is the arm's controller off the bus? Two masters disturb each other",
    ];
    owned(&[echo, &checks].concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sevenbot::Joint;

    #[test]
    fn a_pose_that_is_not_reached_comes_with_advice() {
        let [joint, ..] = Joint::ALL;
        let error = MoveError::NotReached { away: vec![(joint, 90, 93)], missing: 0, retargeted: 0 };
        let error = CommandError::from(error);
        assert_eq!(error.status(), 1);
        assert!(error.advice().concat().contains("`sevenbot status` names blocked joints"), "{error:?}");
    }
}
