//! `stop`: makes every joint hold its position.

use std::collections::BTreeSet;
use std::io::{self, Write};
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
stop, because the port cannot be opened or no arm answers. With --all, that of
the first arm that may not hold.")]
pub(crate) struct StopArgs {
    /// Stop every arm of this computer: behind servers of this user, serial ports, and simulators.
    #[arg(long, conflicts_with = "log")]
    all: bool,
}

/// With `--all` most ports may lead to something else. An arm answers sooner.
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

/// An arm that was stopped.
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

/// What became of the stop of an arm, and its port.
type Outcome = (Result<JointSnapshot, CommandError>, String);

/// Stops all arms at the same time. The ports that a server holds are stopped through the server.
fn stop_all(session: &mut Session) -> Result<(), CommandError> {
    let served: Vec<_> = network::servers().iter().map(network::LocalServer::address).collect();
    let mut failed: Option<CommandError> = None;
    let mut has_stopped = false;
    for (held, port) in stop_each(session, &served) {
        match held {
            Ok(joints) => {
                warn_about_unheld_joints(&joints);
                session.printer.print(&Stopped { port, positions_degrees: positions(&joints) })?;
                has_stopped = true;
            }
            // A port without an arm, or one that another program uses, need not be an arm.
            Err(CommandError::Open { error, .. }) if !served.contains(&port) => {
                warn(format_args!("{port}: {error}"));
            }
            Err(error) => {
                warn(format_args!("{port}: {NO_STOP}"));
                failed.get_or_insert(error);
            }
        }
    }
    match failed {
        Some(error) => Err(error),
        None if has_stopped => Ok(()),
        None => Err(CommandError::NoArm { tried: Vec::new() }),
    }
}

/// Stops each arm in a thread of its own, and waits for all: no arm goes on because the outcome of another cannot be printed.
fn stop_each(session: &Session, served: &[String]) -> Vec<Outcome> {
    let listed = ports::available().into_iter().map(|port| port.name);
    let free = |port: &String| network::serving(port).is_none();
    let free = listed.chain(running_simulators()).chain(session.port.clone()).filter(free);
    let names: BTreeSet<String> = served.iter().cloned().chain(free).collect();
    let options =
        ArmOptions { reply_timeout: session.options.reply_timeout.min(PATIENCE), ..session.options };
    let stop = |name: String| {
        std::thread::spawn(move || {
            let opened = Arm::open_with(&name, options);
            let held = opened.map_err(|error| CommandError::Open { port: name.clone(), error });
            (held.and_then(|mut arm| hold(&mut arm)), name)
        })
    };
    let threads: Vec<_> = names.into_iter().map(stop).collect();
    threads.into_iter().filter_map(|thread| thread.join().ok()).collect()
}
