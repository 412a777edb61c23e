//! The control socket of a simulator: finds it, and exchanges lines.

use std::env;
use std::fs;
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use crate::advice::START_SIMULATOR;
use crate::command_error::CommandError;

/// Time limit for a simulator's answer.
const TIMEOUT: Duration = Duration::from_secs(20);

pub(super) struct SimulatorConnection {
    path: PathBuf,
    stream: BufReader<UnixStream>,
}

impl SimulatorConnection {
    /// Connects to the simulator with this control socket. Without one, looks in the default directory for the simulator whose
    /// arm has this port; without either, for the only one.
    pub(super) fn open(control: Option<&Path>, port: Option<&str>) -> Result<Self, CommandError> {
        if let Some(path) = control {
            return Self::connect(path).map_err(|reason| unreachable(path, &reason));
        }
        let found: Vec<Self> = sockets().iter().filter_map(|path| Self::connect(path).ok()).collect();
        match port {
            Some(port) => Self::with_port(found, port),
            None => Self::the_only(found),
        }
    }

    fn connect(path: &Path) -> io::Result<Self> {
        let stream = UnixStream::connect(path)?;
        stream.set_read_timeout(Some(TIMEOUT))?;
        Ok(Self { path: path.to_owned(), stream: BufReader::new(stream) })
    }

    fn the_only(mut found: Vec<Self>) -> Result<Self, CommandError> {
        match (found.pop(), found.len()) {
            (None, _) => Err(none("no simulator is running")),
            (Some(only), 0) => Ok(only),
            (Some(last), _) => {
                found.push(last);
                let lines = found.iter_mut().map(|connection| {
                    let port = connection.port().unwrap_or_default();
                    format!("--control {}   its port is {port}", connection.path.display())
                });
                let advice = ["use --port PORT, or one of:".to_owned()].into_iter().chain(lines).collect();
                Err(CommandError::NoSimulator {
                    message: "several simulators are running".to_owned(),
                    advice,
                })
            }
        }
    }

    fn with_port(found: Vec<Self>, wanted: &str) -> Result<Self, CommandError> {
        let wanted_port = fs::canonicalize(wanted).unwrap_or_else(|_| wanted.into());
        let is_wanted =
            |connection: &mut Self| connection.port().is_some_and(|port| Path::new(&port) == wanted_port);
        for mut connection in found {
            if is_wanted(&mut connection) {
                return Ok(connection);
            }
        }
        Err(none(&format!("no simulator has the port {wanted}")))
    }

    /// The port of the simulator's arm.
    fn port(&mut self) -> Option<String> {
        let state = self.ask(&json!({ "do": "state" })).ok()?;
        Some(state.get("port")?.as_str()?.to_owned())
    }

    /// Removes the time limit for answers.
    pub(super) fn wait_forever(&mut self) -> Result<(), CommandError> {
        let set = self.stream.get_mut().set_read_timeout(None);
        set.map_err(|reason| unreachable(&self.path, &reason))
    }

    /// Sends a request and waits for its answer.
    pub(super) fn ask(&mut self, request: &Value) -> Result<Value, CommandError> {
        let line = self.exchange(request).map_err(|reason| unreachable(&self.path, &reason))?;
        let mut answer: Value = serde_json::from_str(&line).map_err(|_| {
            unreachable(&self.path, &io::Error::other("it sent something else than an answer"))
        })?;
        if let Some(result) = answer.get_mut("ok") {
            return Ok(result.take());
        }
        let text = |key| answer.get(key).and_then(Value::as_str).unwrap_or("unknown").to_owned();
        Err(CommandError::SimulatorRefused { message: text("error"), hint: text("hint") })
    }

    fn exchange(&mut self, request: &Value) -> io::Result<String> {
        writeln!(self.stream.get_mut(), "{request}")?;
        let mut line = String::new();
        if self.stream.read_line(&mut line)? == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(line)
    }
}

/// The ports of the running simulators whose control sockets are in the default directory.
pub(crate) fn running_ports() -> Vec<String> {
    let mut found: Vec<_> =
        sockets().iter().filter_map(|path| SimulatorConnection::connect(path).ok()).collect();
    found.iter_mut().filter_map(SimulatorConnection::port).collect()
}

/// The control sockets in the default directory. Some may be left from simulators that were killed.
fn sockets() -> Vec<PathBuf> {
    let is_control = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.starts_with("control-") && name.ends_with(".sock")
    };
    let entries = directory().and_then(|directory| fs::read_dir(directory).ok());
    let mut paths: Vec<PathBuf> =
        entries.into_iter().flatten().flatten().map(|entry| entry.path()).filter(is_control).collect();
    paths.sort();
    paths
}

/// The directory in which host-sim creates its control sockets by default: see `host_sim::control::path`.
fn directory() -> Option<PathBuf> {
    let absolute = |name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let directory = absolute("XDG_RUNTIME_DIR").or_else(|| absolute("XDG_STATE_HOME"));
    Some(directory.or_else(|| Some(absolute("HOME")?.join(".local/state")))?.join("7bot"))
}

fn none(message: &str) -> CommandError {
    let advice = [
        START_SIMULATOR,
        "it prints the path of its control socket: use that path with --control",
        "an arm that is no simulation has no control socket",
    ];
    CommandError::NoSimulator { message: message.to_owned(), advice: advice.map(str::to_owned).to_vec() }
}

fn unreachable(path: &Path, reason: &io::Error) -> CommandError {
    let advice = [
        "is the simulator still running? It prints the path of its control socket at start",
        "without --control, `sevenbot sim` finds a simulator that uses the default path",
    ];
    CommandError::NoSimulator {
        message: format!("{}: {reason}", path.display()),
        advice: advice.map(str::to_owned).to_vec(),
    }
}
