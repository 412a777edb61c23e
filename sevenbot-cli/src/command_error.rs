//! How a command can fail: what is said, and the exit status that scripts see.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use sevenbot::servo_bench::ServoError;
use sevenbot::{Error, OpenError};

use crate::advice::{self, owned};
use crate::style::BAD;

/// The exit status after Ctrl-C, as shells have it: 128 and the number of SIGINT.
pub(crate) const INTERRUPTED: u8 = 130;

/// What to do about an arm that may be moving.
const SAFETY: [&str; 3] = [
    "if anybody or anything is in its way, switch the supply of the servos off; the arm then falls",
    "is the cable plugged in at both ends, and the baud rate right (--baud)?",
    "then `sevenbot stop` again",
];

/// Why the program does not end well.
#[derive(Debug)]
pub(crate) enum CommandError {
    /// The arm did not do, or is not, what was asked for.
    Arm(String),
    /// It is not known that the arm did what it was told to do with its motors, for this reason.
    MayMove(String),
    /// The command line makes no sense for this register, or lacks an answer.
    Usage(String),
    /// Nobody said which port, and none leads to an arm: those that were tried, and what came of it.
    NoArm { tried: Vec<(String, OpenError)> },
    /// Nobody said which port, and several lead to an arm.
    SeveralArms { ports: Vec<String> },
    /// The port does not lead to an arm.
    Open { port: String, error: OpenError },
    /// The port opens, but no arm answers there at any rate.
    NoRate { port: String },
    /// The arm went away.
    Exchange(Error),
    /// An exchange with a servo failed.
    Servo { port: String, error: ServoError },
    /// No servo answers at any of the rates and ids that were tried.
    NoServo { port: String, has_echo: bool },
    /// The port of a servo adapter was wanted, but this one leads to an arm's controller.
    HostLink { port: String },
    /// Something did not do what was asked for, and there is advice about it.
    WithAdvice { message: String, advice: &'static [&'static str] },
    /// A file cannot be read or written, or does not hold what it should.
    File { path: PathBuf, reason: String },
    /// What was found out cannot be shown.
    Output(io::Error),
    /// The user wanted it to end.
    Interrupted,
}

impl From<Error> for CommandError {
    fn from(error: Error) -> Self {
        Self::Exchange(error)
    }
}

impl From<io::Error> for CommandError {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

impl CommandError {
    /// A failure with a file, for whatever reason.
    pub(crate) fn file(path: &Path, reason: impl ToString) -> Self {
        Self::File { path: path.to_owned(), reason: reason.to_string() }
    }

    /// Did the connection fail, so that the arm cannot be told anything more?
    pub(crate) const fn is_connection_lost(&self) -> bool {
        matches!(self, Self::Exchange(_) | Self::MayMove(_))
    }

    /// The exit status; `sevenbot --help` lists them.
    pub(crate) fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            // Somebody piped into `head`: it has all it wants.
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => 0,
            Self::Arm(_) | Self::MayMove(_) | Self::File { .. } | Self::Output(_) => 1,
            Self::Usage(_) => 2,
            Self::NoArm { .. } | Self::SeveralArms { .. } => 3,
            Self::Open { .. } | Self::NoRate { .. } | Self::Exchange(_) => 3,
            Self::Servo { error: ServoError::NotTaken { .. }, .. } | Self::WithAdvice { .. } => 1,
            Self::Servo { .. } | Self::NoServo { .. } | Self::HostLink { .. } => 3,
            Self::Interrupted => INTERRUPTED,
        })
    }

    /// Tells the user. Where even that fails, the exit status is all that is left.
    pub(crate) fn report(&self, err: &mut impl Write) {
        let Some(message) = self.message() else { return };
        let _ = writeln!(err, "{BAD}error:{BAD:#} {message}");
        for line in self.advice() {
            let _ = writeln!(err, "  - {line}");
        }
    }

    /// What is wrong; `None` where nobody needs to know.
    pub(crate) fn message(&self) -> Option<String> {
        match self {
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => None,
            Self::Output(error) => Some(format!("cannot write the output: {error}")),
            Self::Arm(message) | Self::Usage(message) => Some(message.clone()),
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
            Self::NoRate { port } => {
                Some(format!("{port}: no arm answers, at any of the rates an arm knows"))
            }
            Self::Exchange(error) => Some(error.to_string()),
            Self::Servo { port, error } => Some(format!("{port}: {error}")),
            Self::NoServo { port, .. } => Some(format!("{port}: no servo answers")),
            Self::HostLink { port } => Some(format!(
                "{port}: this is the arm's host link: its controller answers here, not its servos"
            )),
            Self::WithAdvice { message, .. } => Some(message.clone()),
            Self::File { path, reason } => Some(format!("{}: {reason}", path.display())),
            Self::Interrupted => Some("interrupted".to_owned()),
        }
    }

    fn advice(&self) -> Vec<String> {
        let say_which = "use --port PORT or set SEVENBOT_PORT";
        match self {
            Self::NoArm { tried } => {
                let tried = tried.iter().map(|(port, reason)| format!("{port}: {reason}"));
                let simulator = "`cargo sim -- --link ./7bot` starts a simulated arm, for --port ./7bot";
                tried.chain([say_which, simulator].map(str::to_owned)).collect()
            }
            Self::SeveralArms { .. } => vec![say_which.to_owned()],
            Self::NoRate { .. } => {
                ["has the arm power, and is its cable plugged in at both ends?", "is this the right port?"]
                    .map(str::to_owned)
                    .to_vec()
            }
            Self::MayMove(_) => SAFETY.map(str::to_owned).to_vec(),
            Self::Open { error, .. } => advice::opening(error),
            Self::Exchange(error) => owned(advice::exchange(error)),
            Self::Servo { error, .. } => owned(advice::servo(error)),
            Self::WithAdvice { advice, .. } => owned(advice),
            Self::HostLink { .. } => {
                owned(&["use an adapter on the servo bus, and take the arm's controller off that bus"])
            }
            Self::NoServo { has_echo, .. } => no_servo(*has_echo),
            _ => Vec::new(),
        }
    }
}

/// What to check when no servo answers.
fn no_servo(has_echo: bool) -> Vec<String> {
    let echo: &[&str] = if has_echo { &["the adapter works: it echoes what is sent"] } else { &[] };
    let checks = [
        "do the servos have their own power? The adapter does not supply them",
        "is the signal wire on the adapter's servo side, and the ground common to both?",
        "without --rates and --ids all eight rates and all ids are tried",
        "is the arm's controller off the bus? Two masters disturb each other",
    ];
    owned(&[echo, &checks].concat())
}
