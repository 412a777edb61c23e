//! The resources of every command: the arm and the printer. Chooses the port.

use std::fs::File;
use std::io::ErrorKind;
use std::path::PathBuf;

use sevenbot::health::{ProblemKind, sentences};
use sevenbot::network::{self, Address};
use sevenbot::ports::{self, PortInfo, ProbeResult};
use sevenbot::wire_log::LoggedLine;
use sevenbot::{Arm, ArmOptions, Firmware, OpenError};

use crate::command_error::CommandError;
use crate::printer::{Printer, note, warn};

/// One run of the program.
pub(crate) struct Session {
    /// The port from --port or `SEVENBOT_PORT`; `None`: [`Self::port_name`] chooses one.
    pub(crate) port: Option<String>,
    /// Baud rate, timeout, attempts and register map.
    pub(crate) options: ArmOptions,
    pub(crate) printer: Printer,
    /// The file for all bytes to and from the arm.
    pub(crate) log: Option<PathBuf>,
}

impl Session {
    /// Opens the arm. Warns if its firmware has limits.
    pub(crate) fn connect(&self) -> Result<Arm, CommandError> {
        let port = self.port_name()?;
        let arm = self.open(port)?;
        let version = arm.identity().version();
        match arm.identity().firmware() {
            Firmware::Ours => {}
            Firmware::Makers => warn(format_args!(
                "this arm runs the maker's firmware {version}, which has no status block: faults, missing servos and \
                 moving joints are unknown"
            )),
            Firmware::Unknown => warn(format_args!(
                "this arm runs an unknown firmware, {version}; its status block is not used"
            )),
        }
        Ok(arm)
    }

    /// Opens the arm, without the warnings of [`Self::connect`]. If a server of this user holds the port, connects through
    /// the server.
    pub(crate) fn connect_through_server(&self) -> Result<Arm, CommandError> {
        let port = self.port_name()?;
        match self.open(port.clone()) {
            Err(CommandError::Open { error: OpenError::Busy, .. }) => {
                let Some(server) = network::serving(&port) else {
                    return Err(CommandError::Open { port, error: OpenError::Busy });
                };
                note(format_args!("{port}: through `sevenbot serve`, which holds this port"));
                self.open(server.address())
            }
            opened => opened,
        }
    }

    /// As [`Self::connect`], for a command that moves the arm. Also waits for the watchdog of a killed program, calls
    /// [`put_right`], and warns of joint problems that a move of other joints does not report.
    pub(crate) fn connect_to_move(&self) -> Result<Arm, CommandError> {
        let mut arm = self.connect()?;
        arm.let_watchdog_act()?;
        put_right(&mut arm)?;
        warn_of_lame_joints(&mut arm)?;
        Ok(arm)
    }

    /// Opens a port, with a log if `--log` was given. Fails if the log file exists already.
    fn open(&self, port: String) -> Result<Arm, CommandError> {
        let failed = |error| CommandError::Open { port: port.clone(), error };
        let Some(path) = &self.log else { return Arm::open_with(&port, self.options).map_err(failed) };
        let line = network::open_line(&port, self.options.baud).map_err(failed)?;
        let file = File::create_new(path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => {
                CommandError::file(path, "the file exists: choose a new name for the log")
            }
            _ => CommandError::file(path, error),
        })?;
        let logged = LoggedLine::new(line, Box::new(file), &port, self.options.baud);
        let line = logged.map_err(|error| CommandError::file(path, error))?;
        Arm::over(Box::new(line), &port, self.options).map_err(failed)
    }

    /// The port from the command line, or the only one that leads to an arm, also through a server of this user. If there is
    /// none, the port of the only simulator that runs: the list of serial ports has no pseudo-terminals.
    pub(crate) fn port_name(&self) -> Result<String, CommandError> {
        self.port_among(ports::reachable)
    }

    /// As [`Self::port_name`], for a command that cannot work through a server: only ports of this computer.
    pub(crate) fn own_port_name(&self) -> Result<String, CommandError> {
        self.port.as_deref().map_or(Ok(()), check_is_no_server)?;
        self.port_among(ports::available)
    }

    fn port_among(&self, list: impl FnOnce() -> Vec<PortInfo>) -> Result<String, CommandError> {
        if let Some(port) = &self.port {
            return Ok(port.clone());
        }
        match the_only(ports::probe(list(), self.options.baud)) {
            Err(no_arm @ CommandError::NoArm { .. }) => simulator(running_simulators(), no_arm),
            found => found,
        }
    }
}

/// Fails if the port is the address of a server.
pub(crate) fn check_is_no_server(port: &str) -> Result<(), CommandError> {
    Address::parse(port).map_or(Ok(()), |_| {
        let reason = "is a server, and this command needs a port of this computer, such as /dev/ttyUSB0: `sevenbot ports` lists them";
        Err(CommandError::Usage(format!("{port} {reason}")))
    })
}

/// Resets the registers that a program left changed when it was killed during a stream, and tells the user.
pub(crate) fn put_right(arm: &mut Arm) -> Result<(), CommandError> {
    if arm.end_abandoned_stream()? {
        note(
            "a program ended while it streamed, and the arm's watchdog acted: its period, watchdog and reports are switched \
             off, and speeds at the maximum have their default again",
        );
    }
    Ok(())
}

/// Warns of what a move of other joints does not report: an alarm of a servo, whose joint may hold no torque, and joints that are
/// silent or let go.
fn warn_of_lame_joints(arm: &mut Arm) -> Result<(), CommandError> {
    let mut problems = arm.health()?.problems();
    let is_lame =
        |kind: ProblemKind| kind.is_alarm() || matches!(kind, ProblemKind::NoAnswer | ProblemKind::LetGo);
    problems.retain(|problem| is_lame(problem.kind));
    if !problems.is_empty() {
        warn(format_args!("{}; `sevenbot status` tells what to do", sentences(&problems)));
    }
    Ok(())
}

fn the_only(probed: Vec<ProbeResult>) -> Result<String, CommandError> {
    let (arms, others): (Vec<_>, Vec<_>) = probed.into_iter().partition(|found| found.answer.is_ok());
    let names = |found: &[ProbeResult]| found.iter().map(|found| found.port.name.clone()).collect::<Vec<_>>();
    match arms.as_slice() {
        [only] => {
            note(format_args!("using {}, the only port that leads to an arm", only.port.name));
            Ok(only.port.name.clone())
        }
        [] => Err(CommandError::NoArm { tried: others.into_iter().filter_map(reason).collect() }),
        several => Err(CommandError::SeveralArms { ports: names(several) }),
    }
}

#[cfg(unix)]
pub(crate) fn running_simulators() -> Vec<String> {
    crate::commands::sim::running_ports()
}

#[cfg(not(unix))]
pub(crate) const fn running_simulators() -> Vec<String> {
    Vec::new()
}

/// The port of the only simulator that runs; `no_arm` if none runs.
fn simulator(running: Vec<String>, no_arm: CommandError) -> Result<String, CommandError> {
    match running.as_slice() {
        [] => Err(no_arm),
        [only] => {
            note(format_args!("using {only}, the port of the only simulator that runs"));
            Ok(only.clone())
        }
        _ => Err(CommandError::SeveralArms { ports: running }),
    }
}

/// A port without an arm, and the reason.
fn reason(found: ProbeResult) -> Option<(String, OpenError)> {
    Some((found.port.name, found.answer.err()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sevenbot::ports::PortInfo;

    #[test]
    fn ports_without_an_arm_are_listed_with_reasons() {
        let port = PortInfo { name: "COM1".to_owned(), description: String::new() };
        let found = the_only(vec![ProbeResult { port, answer: Err(OpenError::Busy) }]);
        let Err(CommandError::NoArm { tried }) = found else { panic!("no arm: {found:?}") };
        assert!(matches!(tried.as_slice(), [(name, OpenError::Busy)] if name == "COM1"));
        assert!(matches!(the_only(Vec::new()), Err(CommandError::NoArm { tried }) if tried.is_empty()));
    }

    #[test]
    fn without_an_arm_the_only_simulator_is_used() {
        let chosen = |running: &[&str]| {
            let running = running.iter().map(|&port| port.to_owned()).collect();
            simulator(running, CommandError::NoArm { tried: Vec::new() })
        };
        assert!(matches!(chosen(&["/dev/pts/7"]), Ok(port) if port == "/dev/pts/7"));
        assert!(matches!(chosen(&[]), Err(CommandError::NoArm { .. })));
        assert!(matches!(chosen(&["a", "b"]), Err(CommandError::SeveralArms { ports }) if ports.len() == 2));
    }
}
