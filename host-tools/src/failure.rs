//! How a command can fail: what is said, and the exit status that scripts see.

use std::io::{self, Write};
use std::process::ExitCode;

use anstyle::{AnsiColor, Style};
use sevenbot::{Error, OpenError};

/// Why the program does not end well.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The arm did not do, or is not, what was asked for.
    Arm(String),
    /// The command line makes no sense for this register.
    Usage(String),
    /// Nobody said which port.
    NoPort,
    /// The port does not lead to an arm.
    Open { port: String, error: OpenError },
    /// The arm went away.
    Wire(Error),
    /// What was found out cannot be shown.
    Output(io::Error),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Wire(error)
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

impl Failure {
    /// 1: the arm said no. 2: wrong usage, as clap has it. 3: no connection. `sevenbot --help` says the same.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            // Somebody piped into `head`: it has all it wants.
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
            Self::Arm(_) | Self::Output(_) => ExitCode::from(1),
            Self::Usage(_) | Self::NoPort => ExitCode::from(2),
            Self::Open { .. } | Self::Wire(_) => ExitCode::from(3),
        }
    }

    /// Tells the user. Where even that fails, the exit status is all that is left.
    pub(crate) fn report(&self, err: &mut impl Write) {
        let red = Style::new().bold().fg_color(Some(AnsiColor::Red.into()));
        let Some(message) = self.message() else { return };
        let _ = writeln!(err, "{red}error:{red:#} {message}");
        for line in self.advice() {
            let _ = writeln!(err, "  - {line}");
        }
    }

    fn message(&self) -> Option<String> {
        match self {
            Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => None,
            Self::Output(error) => Some(format!("cannot write the output: {error}")),
            Self::Arm(message) | Self::Usage(message) => Some(message.clone()),
            Self::NoPort => Some("no port given: use --port PORT or set SEVENBOT_PORT".to_owned()),
            Self::Open { port, error } => Some(format!("{port}: {error}")),
            Self::Wire(error) => Some(error.to_string()),
        }
    }

    fn advice(&self) -> Vec<String> {
        let lines = match self {
            Self::NoPort => return vec![ports_here()],
            Self::Open { error, .. } => error.advice(),
            Self::Wire(error) => error.advice(),
            _ => &[],
        };
        lines.iter().map(|&line| line.to_owned()).collect()
    }
}

fn ports_here() -> String {
    let ports = serialport::available_ports().unwrap_or_default();
    let names: Vec<String> = ports.into_iter().map(|port| port.port_name).collect();
    if names.is_empty() {
        "this machine has no serial port; `cargo sim` starts a simulated arm and says its port".to_owned()
    } else {
        format!("serial ports on this machine: {}", names.join(", "))
    }
}
