//! `servo`: single servos through an adapter on the servo bus, without the arm's controller.

mod center;
mod info;
mod port;
mod registers;
mod scan;
mod set_id;
mod torque_codes;

use clap::{Args, Subcommand};

use crate::command_error::CommandError;
use crate::session::Session;

/// Scan, show and set up single servos through an adapter on the servo bus.
///
/// For building and repairing an arm. The port is a half-duplex TTL adapter for bus servos, such as Feetech's FE-URT-1
/// or Waveshare's Bus Servo Adapter. The servos need their own power. The port is not the arm's host link. Disconnect
/// the arm's controller from the bus first, because two masters disturb each other.
#[derive(Debug, Args)]
#[command(after_help = "\
The rate of the servo bus is --rate, or --rates of a scan; --baud is the rate of
an arm's host link.

Each joint's servo has its own id: joint 1 has id 0, joint 7 has id 6. A new
servo usually has id 1 or 0.

Examples:
  export SEVENBOT_PORT=/dev/ttyUSB0
                               the adapter
  sevenbot servo scan          which servos are there, and at which baud rate?
  sevenbot servo info 3        the servo of joint 4: position, supply, limits
  sevenbot servo dump 3        all its registers, by name
  sevenbot servo set 3 max-torque 800
                               writes one, with a check of its range
  sevenbot servo set-id 1 3    gives a new servo, alone on the bus, the id of
                               joint 4
  sevenbot servo center 3      turns it to its middle, before its horn goes on
  sevenbot servo torque-codes  which of the two tables of register 40 do they
                               have?

A simulated bus: `host-sim --servos-only --link ./bus`, then --port ./bus")]
pub(crate) struct ServoArgs {
    #[command(subcommand)]
    command: ServoSubcommand,
}

#[derive(Debug, Subcommand)]
enum ServoSubcommand {
    Scan(scan::ScanArgs),
    Info(info::ServoInfoArgs),
    Get(registers::GetRegistersArgs),
    Set(registers::SetRegisterArgs),
    Dump(registers::DumpArgs),
    SetId(set_id::SetIdArgs),
    Center(center::CenterArgs),
    TorqueCodes(torque_codes::TorqueCodesArgs),
}

pub(crate) fn run(session: &mut Session, args: &ServoArgs) -> Result<(), CommandError> {
    match &args.command {
        ServoSubcommand::Scan(args) => scan::run(session, args),
        ServoSubcommand::Info(args) => info::run(session, args),
        ServoSubcommand::Get(args) => registers::run_get(session, args),
        ServoSubcommand::Set(args) => registers::run_set(session, args),
        ServoSubcommand::Dump(args) => registers::run_dump(session, args),
        ServoSubcommand::SetId(args) => set_id::run(session, args),
        ServoSubcommand::Center(args) => center::run(session, args),
        ServoSubcommand::TorqueCodes(args) => torque_codes::run(session, args),
    }
}
