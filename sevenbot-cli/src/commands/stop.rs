//! `stop`: makes every joint hold its position.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;
use sevenbot::joints::JointSnapshot;
use sevenbot::{Arm, ArmOptions, network, ports};

use super::pose::Positions;
use crate::command_error::CommandError;
use crate::interrupt::{hold, warn_about_unheld_joints};
use crate::printer::{Printable, warn};
use crate::session::{Session, running_simulators};

/// Stop: make every joint hold its position.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sets the targets to the measured positions, reads them back, and repeats the
write if necessary. A joint that has reached its target keeps it. Then watches
for half a second whether the joints hold. Writes nothing if the motors are off
(state 0 or 2).

If `sevenbot serve` of the same user holds the port, the stop goes through it,
before everything else. It ends what other programs stream until they pause for
a second.

Exit status 1 if the arm may not hold: it may still be moving, a joint does not
answer or has let go, or another program sends it elsewhere. 3 if it received no
stop, because the port cannot be opened or no arm answers. With --all, the
exit status is the one of the first arm that may not hold. Of the ports that
cannot be opened, only a server, a simulator and the one of --port count.")]
pub(crate) struct StopArgs {
    /// Stop every arm of this computer: behind servers of this user, serial ports, and simulators.
    #[arg(long, conflicts_with = "log")]
    all: bool,
}

/// The longest reply timeout with `--all`, where most ports may lead to other devices. An arm answers sooner.
const PATIENCE: Duration = Duration::from_millis(500);

const NO_STOP: &str =
    "the arm received no stop and may be moving; switch off the supply of the servos to stop it";

pub(crate) fn run(session: &mut Session, args: &StopArgs) -> Result<(), CommandError> {
    if args.all {
        return stop_all(session);
    }
    let mut arm = session.connect_through_server().inspect_err(|_| warn(NO_STOP))?;
    let joints = hold(&mut arm)?;
    warn_about_unheld_joints(&joints);
    session.printer.print(&Positions { positions_degrees: positions(&joints) })
}

fn positions(joints: &JointSnapshot) -> [u8; 7] {
    if joints.is_driven() { joints.targets() } else { joints.positions() }
}

#[derive(Serialize)]
struct Stopped {
    port: String,
    positions_degrees: [u8; 7],
}

impl Printable for Stopped {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let angles: Vec<String> = self.positions_degrees.iter().map(u8::to_string).collect();
        writeln!(out, "{}  {}", self.port, angles.join(" "))
    }
}

/// The result of stopping an arm, and the port of the arm.
type StopResult = (Result<JointSnapshot, CommandError>, String);

/// Stops all arms at the same time. An arm whose port a server holds is stopped through the server.
fn stop_all(session: &mut Session) -> Result<(), CommandError> {
    let served: Vec<_> = network::servers().iter().map(network::LocalServer::address).collect();
    let simulators = running_simulators();
    // Any other port may lead to another device: a failure to open it is only a warning, unless no arm was found.
    let is_arm = |port: &String| served.iter().chain(&simulators).chain(&session.port).any(|arm| arm == port);
    let mut failed: Option<CommandError> = None;
    let (mut has_stopped, mut tried) = (false, Vec::new());
    for (held, port) in stop_each(session, &served, &simulators) {
        match held {
            Ok(joints) => {
                warn_about_unheld_joints(&joints);
                session.printer.print(&Stopped { port, positions_degrees: positions(&joints) })?;
                has_stopped = true;
            }
            Err(CommandError::Open { error, .. }) if !is_arm(&port) => tried.push((port, error)),
            Err(error) => {
                warn(format_args!("{port}: {NO_STOP}"));
                failed.get_or_insert(error);
            }
        }
    }
    if failed.is_none() && !has_stopped {
        return Err(CommandError::NoArm { tried });
    }
    tried.iter().for_each(|(port, error)| warn(format_args!("{port}: {error}")));
    failed.map_or(Ok(()), Err)
}

/// Stops each arm in a thread of its own, and waits for all threads. The caller prints afterwards, so that an output error
/// cannot prevent a stop.
fn stop_each(session: &Session, served: &[String], simulators: &[String]) -> Vec<StopResult> {
    let listed = ports::available().into_iter().map(|port| port.name);
    let free = |port: &String| network::serving(port).is_none();
    let free = listed.chain(simulators.iter().cloned()).chain(session.port.clone()).filter(free);
    let ports: BTreeMap<_, _> = served.iter().cloned().chain(free).map(by_path).collect();
    let options =
        ArmOptions { reply_timeout: session.options.reply_timeout.min(PATIENCE), ..session.options };
    let stop = |name: String| {
        std::thread::spawn(move || {
            let opened = Arm::open_with(&name, options);
            let held = opened.map_err(|error| CommandError::Open { port: name.clone(), error });
            (held.and_then(|mut arm| hold(&mut arm)), name)
        })
    };
    let threads: Vec<_> = ports.into_values().map(stop).collect();
    threads.into_iter().filter_map(|thread| thread.join().ok()).collect()
}

/// The port, with its canonical path as the key. So a port with two names is opened once. Otherwise a second thread would
/// find it busy.
fn by_path(port: String) -> (PathBuf, String) {
    (fs::canonicalize(&port).unwrap_or_else(|_| PathBuf::from(&port)), port)
}
