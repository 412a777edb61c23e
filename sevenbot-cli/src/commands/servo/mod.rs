//! `servo`: single servos through an adapter on the servo bus, without the arm's controller.
//!
//! Chooses the port and explains failures. What is done with the servos is in one file a subcommand.

mod center;
mod info;
mod scan;
mod set_id;
mod torque_codes;

use clap::{Args, Subcommand, builder::RangedI64ValueParser, value_parser};
use sevenbot::servo_bench::{BAUD_RATES, Error, Heard, MAX_ID, Options, ServoBus};
use sevenbot::{Arm, ports};

use crate::failure::Failure;
use crate::session::Session;

/// Scan, show and set up single servos through an adapter on the servo bus.
///
/// For building and repairing an arm. The port is a half-duplex TTL adapter for bus servos, such as Feetech's FE-URT-1
/// or Waveshare's Bus Servo Adapter, with the servos on it and their power on. It is not the arm's host link: take the
/// arm's controller off the bus first, because two masters disturb each other.
#[derive(Debug, Args)]
#[command(after_help = "\
The rate of the servo bus is --rate, or --rates of a scan; --baud is that of an arm's host link.

Each joint's servo has its own id: joint 1 has id 0, joint 7 has id 6. A new servo has another one, mostly 1 or 0.

Examples:
  export SEVENBOT_PORT=/dev/ttyUSB0            the adapter
  sevenbot servo scan                          which servos are there, and at which baud rate?
  sevenbot servo info 3                        the servo of joint 4: position, supply, limits
  sevenbot servo set-id 1 3                    makes a new servo that of joint 4, alone on the bus
  sevenbot servo center 3                      turns it to its middle, before its horn goes on
  sevenbot servo torque-codes                  which of the two tables of register 40 do they have?

A simulated bus: `host-sim --servos-only --link ./bus`, then --port ./bus")]
pub(crate) struct ServoArgs {
    #[command(subcommand)]
    command: ServoCommand,
}

#[derive(Debug, Subcommand)]
enum ServoCommand {
    Scan(scan::ScanArgs),
    Info(info::InfoArgs),
    SetId(set_id::SetIdArgs),
    Center(center::CenterArgs),
    TorqueCodes(torque_codes::TorqueCodesArgs),
}

pub(crate) fn run(session: &mut Session, args: &ServoArgs) -> Result<(), Failure> {
    match &args.command {
        ServoCommand::Scan(args) => scan::run(session, args),
        ServoCommand::Info(args) => info::run(session, args),
        ServoCommand::SetId(args) => set_id::run(session, args),
        ServoCommand::Center(args) => center::run(session, args),
        ServoCommand::TorqueCodes(args) => torque_codes::run(session, args),
    }
}

/// The baud rate of the bus, where only one is wanted.
#[derive(Clone, Copy, Debug, Args)]
struct Rate {
    /// Baud rate of the servo bus.
    #[arg(long, value_name = "RATE", default_value_t = 1_000_000, value_parser = rate)]
    rate: u32,
}

/// One of the eight rates of an SCS servo.
fn rate(text: &str) -> Result<u32, String> {
    let known = text.parse().ok().filter(|rate| BAUD_RATES.contains(rate));
    known.ok_or_else(|| format!("servos know {}", BAUD_RATES.map(|rate| rate.to_string()).join(", ")))
}

/// An id that a servo can have.
fn id() -> RangedI64ValueParser<u8> {
    value_parser!(u8).range(..=i64::from(MAX_ID))
}

/// The adapter's port. It cannot be guessed: asking every port would send to whatever is there.
fn port(session: &Session) -> Result<String, Failure> {
    let how = "`sevenbot servo` needs the adapter's port: use --port PORT or set SEVENBOT_PORT";
    session.port.clone().ok_or_else(|| Failure::Usage(how.to_owned()))
}

/// Opens the bus.
fn open(session: &Session, baud: u32) -> Result<ServoBus, Failure> {
    let port = port(session)?;
    let options = Options { reply_timeout: session.options.reply_timeout, ..Options::default() };
    ServoBus::open(&port, baud, options).map_err(|error| Failure::Open { port, error })
}

/// The failure for an exchange that went wrong. Where no servo was heard, an arm is looked for: its host link is the
/// port that is most often taken for an adapter.
fn failure(session: &Session, bus: ServoBus, error: Error) -> Failure {
    let is_silent =
        matches!(error, Error::NoAnswer { heard: Heard { other_frames: 0, damaged_frames: 0, .. }, .. });
    match port(session) {
        Err(failure) => failure,
        Ok(port) if is_silent && leads_to_arm(session, bus, &port) => Failure::HostLink { port },
        Ok(port) => Failure::Servo { port, error },
    }
}

/// Does the controller of an arm answer on this port, at any of its rates?
fn leads_to_arm(session: &Session, bus: ServoBus, port: &str) -> bool {
    // The port can be opened only once.
    drop(bus);
    let patient = sevenbot::Options { attempts: 1, ..session.options };
    Arm::open_with(port, patient).is_ok() || ports::find_baud(port, |_| ()).is_ok()
}
