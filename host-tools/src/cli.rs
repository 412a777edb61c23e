//! The command line: what can be said, and the help that teaches it.
//!
//! Knows no arm.

use clap::{ArgAction, Args, Parser, Subcommand, value_parser};
use sevenbot::Span;
use sevenbot::names;

const EXAMPLES: &str = "\
Examples:
  sevenbot --port /dev/ttyUSB0 info
  export SEVENBOT_PORT=/dev/ttyUSB0
  sevenbot pose 120 90 65 90 90 90 80 --speed 30 --wait
  sevenbot get present-position
  sevenbot monitor

Exit status:
  0  done
  1  the arm did not take or do what was asked, or `info` found a fault
  2  the command line makes no sense
  3  no connection: the port cannot be opened, nobody answers, or no 7Bot V2 does";

/// Talks to a 7Bot V2 robot arm over its serial port: a real one, a simulated one, or the firmware in an
/// emulator.
#[derive(Debug, Parser)]
#[command(name = "sevenbot", version, after_help = EXAMPLES)]
pub(crate) struct Cli {
    /// The serial port the arm is on, such as /dev/ttyUSB0, COM3, or the link of the simulator.
    #[arg(long, global = true, env = "SEVENBOT_PORT")]
    pub(crate) port: Option<String>,
    /// Baud rate of the port. The arm starts with the one in its register 12.
    #[arg(long, global = true, default_value_t = 115_200, value_parser = value_parser!(u32).range(1..))]
    pub(crate) baud: u32,
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show who the arm is, its settings, and how it is.
    ///
    /// Exit status 1 when the arm reports a fault or a servo does not answer.
    Info,
    /// Show registers.
    Get(GetArgs),
    /// Write registers, read them back, and say what did not take and why.
    Set(SetArgs),
    /// Send all seven joints to a pose.
    Pose(PoseArgs),
    /// Watch targets, positions and movement; Ctrl-C ends it.
    Monitor(MonitorArgs),
}

const NAMES: &str = "\
Registers are named as in docs/registers.md, in any case, with - or _, as short as the name is still
the only one; .3 is the third joint's. A number is an address, A..B all from A to B.";

#[derive(Debug, Args)]
#[command(after_help = format!("{NAMES}

Examples:
  sevenbot get target-position          all seven
  sevenbot get speed.3 motor-state 12
  sevenbot get --raw 54..60"))]
pub(crate) struct GetArgs {
    /// Names, numbers or ranges of registers.
    #[arg(required = true, value_name = "REGISTER", value_parser = names::parse)]
    pub(crate) registers: Vec<Span>,
    /// Show the bytes as they are.
    #[arg(long)]
    pub(crate) raw: bool,
}

#[derive(Debug, Args)]
#[command(after_help = format!("{NAMES}

Examples:
  sevenbot set speed 30                 all seven joints
  sevenbot set target-position.3 70
  sevenbot set motor-state 2            forceless: the arm can be moved by hand, and falls
  sevenbot set --unlock offset.2 -5     settings are kept over power cuts, and locked

Exit status 1 when a register did not take its value."))]
pub(crate) struct SetArgs {
    /// Name, number or range of registers.
    #[arg(value_name = "REGISTER", value_parser = names::parse)]
    pub(crate) register: Span,
    /// One value per register, or one for all of them, in the units of the table.
    #[arg(required = true, value_name = "VALUE", allow_negative_numbers = true, value_parser = number)]
    pub(crate) values: Vec<i16>,
    /// The values are bytes as they go on the wire (0 to 255, or 0x00 to 0xFF), sent unchecked.
    #[arg(long)]
    pub(crate) raw: bool,
    /// Open the EEPROM lock (register 28) before and close it after.
    #[arg(long)]
    pub(crate) unlock: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot pose 90 90 65 90 90 90 80               the standard pose
  sevenbot pose 120 90 65 90 90 90 80 --speed 30   at 57 degrees per second
  sevenbot pose 60 90 65 90 90 90 80 --time 20 --wait

Exit status 1 when the arm did not take the pose, or with --wait did not reach it.")]
pub(crate) struct PoseArgs {
    /// Angles of joint 1 to 7 in degrees, 0 to 180.
    #[arg(value_names = ["A1", "A2", "A3", "A4", "A5", "A6", "A7"], num_args = 7, required = true,
          action = ArgAction::Set,
          value_parser = value_parser!(u8).range(0..=180))]
    pub(crate) angles: Vec<u8>,
    /// Speed of all joints in steps of 1.9 degrees per second, 1 to 100; 0 is the motors' maximum.
    #[arg(long, value_name = "N", value_parser = value_parser!(u8).range(0..=100))]
    pub(crate) speed: Option<u8>,
    /// Duration of the move in steps of 100 ms, 0 to 100; sets the speeds to 0, or it would not count.
    #[arg(long, value_name = "N", conflicts_with = "speed", value_parser = value_parser!(u8).range(0..=100))]
    pub(crate) time: Option<u8>,
    /// Wait until the arm is there.
    #[arg(long)]
    pub(crate) wait: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
On a terminal the table is redrawn in place; into a pipe or a file goes one line a sample.

Examples:
  sevenbot monitor
  sevenbot monitor --hz 20 --samples 100 > move.txt")]
pub(crate) struct MonitorArgs {
    /// Samples a second.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = value_parser!(u8).range(1..=50))]
    pub(crate) hz: u8,
    /// End after so many samples.
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..))]
    pub(crate) samples: Option<u64>,
}

/// A number in decimal or, after 0x, in hexadecimal digits.
fn number(text: &str) -> Result<i16, String> {
    let hexadecimal = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let parsed = match hexadecimal {
        Some(digits) => u8::from_str_radix(digits, 16).map(i16::from),
        None => text.parse(),
    };
    parsed.map_err(|_| "not a number that a register could hold".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn numbers_are_decimal_or_hexadecimal() {
        assert_eq!(number("-5"), Ok(-5));
        assert_eq!(number("0x85"), Ok(0x85));
        assert!(number("0x100").is_err());
        assert!(number("five").is_err());
    }

    #[test]
    fn negative_values_are_no_options() {
        let cli = Cli::try_parse_from(["sevenbot", "set", "offset.2", "-5"]).expect("a value");
        assert!(matches!(cli.command, Command::Set(SetArgs { values, .. }) if values == [-5]));
    }
}
