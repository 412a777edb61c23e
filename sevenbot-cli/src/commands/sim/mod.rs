//! `sim`: controls a running simulator through its control socket, apart from the arm's port.

mod socket;
mod text;
mod values;

use std::fmt::Display;
use std::path::{Path, PathBuf};

use arm_sim::faults::FAULTS_HELP;
use arm_sim::scene::Scene;
use clap::{Args, Subcommand, ValueEnum};
use serde::Serialize;
use serde_json::{Value, json};

use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::session::Session;
use socket::SimulatorConnection;
pub(crate) use socket::running_ports;
use values::{factor, grams, hand, millis};

/// Control a running simulator: faults, obstacles, things on the table, a hand, a weight, power, virtual time.
///
/// host-sim opens a control socket beside the arm's port. These commands use it, so that another program can drive the
/// arm at the same time. All durations are virtual time.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  host-sim --link ./7bot           in another terminal; in the source tree:
                                   cargo sim -- --link ./7bot
  sevenbot sim fault 3=missing --for 2s
                                   joint 3 does not answer for two seconds
  sevenbot sim fault line=loss=1%  the host line loses a byte in a hundred,
                                   until it is cleared
  sevenbot sim fault list          the faults, and how often each took effect
  sevenbot sim hand 2 120          a hand turns joint 2 to 120 degrees, and
                                   holds it there
  sevenbot sim weight 150g         a weight in the gripper
  sevenbot sim fault 2=wall=60     a wall at 60 degrees, in the way of joint 2
  sevenbot sim scene cubes.txt     things to grip and to stack
  sevenbot sim trip 2              the servo of joint 2 latches an overload
  sevenbot sim power cycle         off and on
  sevenbot sim speed 50x           virtual time; also max, pause, resume,
                                   advance 250ms
  sevenbot sim snapshot before     keeps a copy of the arm; `restore before`
                                   returns to it
  sevenbot sim state               the true angles, whatever the arm says

Without --control the only simulator that is running is used, or the one whose
port is --port. host-sim prints the path of its socket when it starts.

Exit status: 1 if the simulator refused, 3 if none was found.")]
pub(crate) struct SimArgs {
    /// Control socket of the simulator.
    #[arg(long, global = true, value_name = "PATH", env = "SEVENBOT_CONTROL", hide_env_values = true)]
    control: Option<PathBuf>,
    #[command(subcommand)]
    command: SimCommand,
}

#[derive(Debug, Subcommand)]
enum SimCommand {
    Fault(FaultArgs),
    Hand(HandArgs),
    Weight(WeightArgs),
    /// Drop what is in the gripper: the thing between the claws, and the weight.
    Drop,
    Scene(SceneArgs),
    Trip(TripArgs),
    /// Switch the power of the arm.
    Power {
        /// 'off' loses what is in RAM, and loaded joints fall; 'cycle' is off and on.
        to: PowerArg,
    },
    /// Restart the controller, as its watchdog does. The servos keep power, torque and goals.
    Restart,
    /// Stop the controller, as if its program hung, until `restart` or `power cycle`.
    Halt,
    /// Stop virtual time. The port is still served.
    Pause,
    /// Let virtual time go on after `pause`.
    Resume,
    Advance(AdvanceArgs),
    Speed(SpeedArgs),
    /// Keep a copy of the arm and of virtual time, until the simulator ends.
    Snapshot(SnapshotArgs),
    /// Set the arm and virtual time back to a copy: registers, settings, motion, faults, bytes on the host line.
    Restore(SnapshotArgs),
    /// Show the true state of the arm: angles, torque, loads, supply and faults.
    State,
}

/// Give the arm a fault, list the faults, or take them back.
#[derive(Debug, Args)]
#[command(after_help = format!("\
Faults:
{FAULTS_HELP}

Examples:
  sevenbot sim fault 3=garbled=10  until it is cleared
  sevenbot sim fault supply=off --for 500ms
                                   by itself over after half a second of virtual
                                   time
  sevenbot sim fault list          active faults, and those that ended by
                                   themselves
  sevenbot sim fault clear 3       those of joint 3; also line, supply, flash,
                                   bus, arm
  sevenbot sim fault clear         all

A fault that never took effect is marked: a test with such a fault
proves nothing."))]
struct FaultArgs {
    /// The fault, 'list' or 'clear'.
    #[arg(value_name = "FAULT|list|clear")]
    action: String,
    /// With 'clear': the joint, or line, supply, flash, bus or arm.
    at: Option<String>,
    /// The duration, as 2s or 500ms; without it the fault stays until it is cleared.
    #[arg(long = "for", value_name = "TIME", allow_hyphen_values = true, value_parser = millis)]
    for_ms: Option<u64>,
}

/// Turn a joint by hand, hold it, or let it go.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot sim hand 2 120     turns joint 2 to 120 degrees, and holds it there
  sevenbot sim hand 2 hold    holds it where it is, until it has torque
  sevenbot sim hand 2 let-go  without torque, a loaded joint falls

A motor with torque is stronger: it turns the joint back. The fault 2=stuck
keeps it from turning.")]
struct HandArgs {
    /// The joint, 1 to 7.
    joint: u8,
    /// The angle in degrees, 'hold' or 'let-go'.
    #[arg(value_name = "DEGREES|hold|let-go", value_parser = hand)]
    to: Value,
}

/// Put a weight into the gripper; 0 takes it away.
#[derive(Debug, Args)]
struct WeightArgs {
    /// The weight in grams, as 150g or 150, up to 1000.
    #[arg(value_parser = grams)]
    weight: u16,
}

/// Put things on the table that can be gripped, pushed and stacked.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot sim scene cubes.txt     in the file: cube red 30 40 0 200
                                                cube blue 30 40 -80 190
  sevenbot sim scene off           an arm without a table
  sevenbot sim state               where everything is

A line of a scene is one of these. Lengths are in mm, weights in grams, turns
in degrees, in the frame of the arm: x to the right, y forward, z up.
  table Z
  tool claws                       or: tool cup, for the pump
  wall NAME X Y WIDTH DEPTH HEIGHT
  cube NAME EDGE GRAMS X Y [TURN]
  cylinder NAME DIAMETER HEIGHT GRAMS X Y")]
struct SceneArgs {
    /// File with the scene, or 'off'.
    #[arg(value_name = "FILE|off")]
    file: PathBuf,
}

/// Force an alarm on a servo: it switches its motor off.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot sim trip 2       an overload: free until its torque is switched off
                            and on
  sevenbot sim trip 2 heat  5 degrees C too hot: free until it has cooled down,
                            then its torque comes back by itself, towards the
                            goal it holds

A loaded joint falls. A wall in its way trips a servo by itself: `sevenbot sim
fault 2=wall=60`.")]
struct TripArgs {
    /// The joint, 1 to 7.
    joint: u8,
    /// The alarm.
    #[arg(default_value = "overload")]
    alarm: AlarmArg,
}

/// Let virtual time pass as fast as possible, and wait for its end.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  sevenbot sim pause
  sevenbot sim advance 250ms                   a pause goes on after it")]
struct AdvanceArgs {
    /// The virtual time, as 250ms or 2s.
    #[arg(value_parser = millis)]
    time: u64,
}

/// Set the speed of virtual time.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot sim speed 50x                       a minute takes 1.2 seconds
  sevenbot sim speed max                       as fast as the computer can
  sevenbot sim speed 1x                        real time

The baud rate counts in virtual time, but a client thinks in real time: at a
high speed much virtual time passes between its requests. host-sim --lockstep
avoids that.")]
struct SpeedArgs {
    /// The factor from 0.001x to 1000x, or 'max'.
    #[arg(value_name = "FACTOR|max", value_parser = factor)]
    factor: Value,
}

#[derive(Debug, Args)]
struct SnapshotArgs {
    /// Name of the copy, up to 64 characters. A new snapshot replaces one of the same name.
    name: String,
}

#[derive(Clone, Copy, Debug, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
enum AlarmArg {
    /// The servo latches it.
    Overload,
    /// It lasts until the servo has cooled down.
    Heat,
}

#[derive(Clone, Copy, Debug, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
enum PowerArg {
    On,
    Off,
    Cycle,
}

struct SimulatorAnswer<'a> {
    command: &'a SimCommand,
    value: Value,
}

impl Serialize for SimulatorAnswer<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value.serialize(serializer)
    }
}

impl Printable for SimulatorAnswer<'_> {
    fn write_text(&self, out: &mut dyn std::io::Write) -> std::io::Result<()> {
        match self.command {
            SimCommand::Fault(args) => text::faults(out, &args.action, &self.value),
            SimCommand::Hand(args) => text::hand(out, args.joint, &self.value),
            SimCommand::State => text::state(out, &self.value),
            SimCommand::Scene(_) => text::objects(out, &self.value),
            SimCommand::Snapshot(_) | SimCommand::Restore(_) => text::snapshot(out, &self.value),
            SimCommand::Pause | SimCommand::Resume | SimCommand::Advance(_) | SimCommand::Speed(_) => {
                text::time(out, &self.value)
            }
            SimCommand::Weight(_)
            | SimCommand::Drop
            | SimCommand::Trip(_)
            | SimCommand::Power { .. }
            | SimCommand::Restart
            | SimCommand::Halt => Ok(()),
        }
    }
}

pub(crate) fn run(session: &mut Session, args: &SimArgs) -> Result<(), CommandError> {
    let request = request(&args.command)?;
    let mut connection = SimulatorConnection::open(args.control.as_deref(), session.port.as_deref())?;
    if matches!(args.command, SimCommand::Advance(_)) {
        connection.wait_forever()?;
    }
    let value = connection.ask(&request)?;
    session.printer.print(&SimulatorAnswer { command: &args.command, value })
}

fn request(command: &SimCommand) -> Result<Value, CommandError> {
    Ok(match command {
        SimCommand::Fault(args) => return fault_request(args),
        SimCommand::Hand(HandArgs { joint, to }) => json!({ "do": "hand", "joint": joint, "to": to }),
        SimCommand::Weight(WeightArgs { weight }) => json!({ "do": "weight", "grams": weight }),
        SimCommand::Drop => json!({ "do": "drop" }),
        SimCommand::Scene(SceneArgs { file }) => json!({ "do": "scene", "scene": scene(file)? }),
        SimCommand::Trip(TripArgs { joint, alarm }) => {
            json!({ "do": "trip", "joint": joint, "alarm": alarm })
        }
        SimCommand::Power { to } => json!({ "do": "power", "to": to }),
        SimCommand::Restart => json!({ "do": "restart" }),
        SimCommand::Halt => json!({ "do": "halt" }),
        SimCommand::Pause => json!({ "do": "pause" }),
        SimCommand::Resume => json!({ "do": "resume" }),
        SimCommand::Advance(AdvanceArgs { time }) => json!({ "do": "advance", "ms": time }),
        SimCommand::Speed(SpeedArgs { factor }) => json!({ "do": "speed", "factor": factor }),
        SimCommand::Snapshot(SnapshotArgs { name }) => json!({ "do": "snapshot", "name": name }),
        SimCommand::Restore(SnapshotArgs { name }) => json!({ "do": "restore", "name": name }),
        SimCommand::State => json!({ "do": "state" }),
    })
}

/// Reads and checks the scene in a file. The name `off` is no file: it is returned as it is.
fn scene(file: &Path) -> Result<String, CommandError> {
    if file == Path::new("off") {
        return Ok("off".to_owned());
    }
    let refusal = |why: &dyn Display| CommandError::Usage(format!("{}: {why}", file.display()));
    let text = std::fs::read_to_string(file).map_err(|why| refusal(&why))?;
    let scene: Scene = text.parse().map_err(|why| refusal(&why))?;
    Ok(scene.to_string())
}

fn fault_request(args: &FaultArgs) -> Result<Value, CommandError> {
    let FaultArgs { action, at, for_ms } = args;
    match (action.as_str(), at, for_ms) {
        ("list", None, None) => Ok(json!({ "do": "faults" })),
        ("clear", at, None) => Ok(json!({ "do": "clear", "at": at })),
        ("list" | "clear", _, Some(_)) => {
            Err(CommandError::Usage("--for belongs to a fault, as in `fault 3=missing --for 2s`".to_owned()))
        }
        (_, Some(at), _) => {
            Err(CommandError::Usage(format!("'{at}' is too much: a location follows only 'clear'")))
        }
        (fault, None, for_ms) => Ok(json!({ "do": "fault", "fault": fault, "for_ms": for_ms })),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_location_follows_only_clear() {
        let args = |action: &str, at: Option<&str>, for_ms| FaultArgs {
            action: action.to_owned(),
            at: at.map(str::to_owned),
            for_ms,
        };
        let ok = |args: FaultArgs| fault_request(&args).ok();
        assert_eq!(ok(args("clear", Some("3"), None)), Some(json!({ "do": "clear", "at": "3" })));
        assert_eq!(ok(args("clear", None, None)), Some(json!({ "do": "clear", "at": null })));
        assert_eq!(ok(args("list", None, None)), Some(json!({ "do": "faults" })));
        let fault = json!({ "do": "fault", "fault": "3=late", "for_ms": 5 });
        assert_eq!(ok(args("3=late", None, Some(5))), Some(fault));
        for wrong in
            [args("list", None, Some(5)), args("list", Some("3"), None), args("3=late", Some("3"), None)]
        {
            assert!(matches!(fault_request(&wrong), Err(CommandError::Usage(_))), "{wrong:?}");
        }
    }
}
