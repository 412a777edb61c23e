//! The command line: global options, commands and help. The arguments of a command are in the command's own file.

use std::error::Error;
use std::ffi::OsString;
use std::num::{IntErrorKind, ParseIntError};
use std::path::PathBuf;

use clap::error::ContextKind;
use clap::{Arg, Args, CommandFactory, FromArgMatches, Parser, Subcommand, value_parser};
use sevenbot::Map;

use crate::command_error::CommandError;
#[cfg(unix)]
use crate::commands::sim;
use crate::commands::{
    backup, baud, calibrate, class, convert, effector, get, info, log, model, monitor, move_to, park, play,
    plot, ports, pose, position, record, recover, registers, serve, servo, set, shell, sniff, state, status,
    stop, stream, view,
};
use crate::session::Session;

const EXAMPLES: &str = "\
Examples:
  sevenbot --port sim info               without an arm: simulated here
  sevenbot --port /dev/ttyUSB0 info
  export SEVENBOT_PORT=/dev/ttyUSB0
  sevenbot pose 120 90 65 90 90 90 80 --speed 30 --wait
  sevenbot move-to 0 185 50 --wait
  sevenbot get present-position --json
  sevenbot monitor

Without --port and SEVENBOT_PORT the only port that leads to an arm is used, or
the port of the only running simulator.

Exit status:
  0    done
  1    the arm refused or failed, `info` or `status` found a fault, or a file
       cannot be used
  2    the arguments are invalid, or a question needs a terminal or --yes
  3    no connection: the port cannot be opened, no 7Bot V2 answers, or the
       connection was lost; an arm that was moving may go on
  130  interrupted by Ctrl-C; a moving arm then holds its position. A second
       Ctrl-C ends at once. Where Ctrl-C is the way to end, it is 0: `monitor`,
       `log`, `record`, `serve`, `view`, `class`

With --json, notes, warnings and errors are JSON, too: one object in a line on
standard error. {\"error\": TEXT, \"advice\": [TEXT, ...], \"status\": NUMBER},
{\"warning\": TEXT}, {\"note\": TEXT}. Wrong arguments are told as text.";

/// The version that `--version` shows; `cargo xtask dist` sets `SEVENBOT_RELEASE` to add the commit.
const VERSION: &str = match option_env!("SEVENBOT_RELEASE") {
    Some(release) => release,
    None => env!("CARGO_PKG_VERSION"),
};

/// Controls a 7Bot V2 robot arm over its serial port. The arm may be real, simulated, or the firmware in an emulator.
#[derive(Debug, Parser)]
#[command(name = "sevenbot", version = VERSION, after_help = EXAMPLES)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Command,
}

impl Cli {
    /// Parses `arguments`, of which the first is the name of the program. An error about a whole number that cannot be
    /// parsed is in plain words.
    pub(crate) fn from_arguments(arguments: impl Iterator<Item = OsString>) -> Result<Self, clap::Error> {
        let matches = with_negative_numbers(Self::command()).try_get_matches_from(arguments);
        matches.and_then(|matches| Self::from_arg_matches(&matches)).map_err(in_plain_words)
    }
}

/// Lets every option take a negative number. Then the error for `-3` names the valid range, not an unknown option.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let allow =
        |arg: Arg| if arg.get_action().takes_values() { arg.allow_negative_numbers(true) } else { arg };
    command.mut_args(allow).mut_subcommands(with_negative_numbers)
}

/// Replaces the message if a value is not a valid integer, and returns other errors unchanged.
fn in_plain_words(error: clap::Error) -> clap::Error {
    let reason = error.source().and_then(|source| source.downcast_ref::<ParseIntError>());
    let what = match reason.map(ParseIntError::kind) {
        None => return error,
        Some(IntErrorKind::PosOverflow | IntErrorKind::NegOverflow) => "it is out of range",
        Some(_) => "use a whole number",
    };
    let part = |kind| error.get(kind).map(ToString::to_string).unwrap_or_default();
    let (argument, value) = (part(ContextKind::InvalidArg), part(ContextKind::InvalidValue));
    let help = "For more information, try '--help'.";
    let message = format!("invalid value '{value}' for '{argument}': {what}\n\n{help}\n");
    clap::Error::raw(error.kind(), message).with_cmd(&Cli::command())
}

/// Options of every command.
#[derive(Debug, Args)]
#[command(next_help_heading = "Options of every command")]
pub(crate) struct Global {
    /// Serial port of the arm: /dev/ttyUSB0, COM3, the link of a simulator. Or a server: unix:PATH, tcp://HOST:PORT, tls://HOST:PORT, sevenbot://NAME. Or sim: an arm simulated in this command, new each time (sim:SEED: with other faults of its line).
    #[arg(long, global = true, env = "SEVENBOT_PORT", hide_env_values = true)]
    pub(crate) port: Option<String>,
    /// Baud rate of the port. The arm starts with the rate in its register 12.
    #[arg(long, global = true, default_value_t = 115_200, value_parser = value_parser!(u32).range(1_200..=4_000_000))]
    pub(crate) baud: u32,
    /// Timeout for an answer in milliseconds. A question whose answer is overdue or damaged is sent again, for up to three times this long.
    #[arg(long, global = true, value_name = "MS", env = "SEVENBOT_TIMEOUT", hide_env_values = true,
          default_value_t = 500, value_parser = value_parser!(u16).range(1..))]
    pub(crate) timeout: u16,
    /// The register map of the arm: 2.1 or 2.2. Without this option the arm's version decides.
    #[arg(long, global = true, value_name = "VERSION", value_parser = map)]
    pub(crate) map: Option<Map>,
    /// Print results as JSON, one value per line; errors and notes too, on standard error.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Write all bytes to and from the arm, with times, to a new FILE. `sevenbot sniff FILE` shows it as text.
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) log: Option<PathBuf>,
    /// Print every frame as text on standard error.
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
}

/// Parses the version of a register map.
fn map(text: &str) -> Result<Map, &'static str> {
    Map::ALL.into_iter().find(|map| map.version() == text).ok_or("the maps are 2.1 and 2.2")
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Ports(ports::PortsArgs),
    Info(info::InfoArgs),
    Status(status::StatusArgs),
    Recover(recover::RecoverArgs),
    Get(get::GetArgs),
    Set(set::SetArgs),
    Pose(pose::PoseArgs),
    Home(pose::HomeArgs),
    Park(park::ParkArgs),
    Where(position::WhereArgs),
    MoveTo(move_to::MoveToArgs),
    Stop(stop::StopArgs),
    State(state::StateArgs),
    Vacuum(effector::VacuumArgs),
    Effector(effector::EffectorArgs),
    Monitor(monitor::MonitorArgs),
    Log(log::LogArgs),
    Record(record::RecordArgs),
    Play(play::PlayArgs),
    Stream(stream::StreamArgs),
    Convert(convert::ConvertArgs),
    Plot(plot::PlotArgs),
    Calibrate(calibrate::CalibrateArgs),
    Baud(baud::BaudArgs),
    Backup(backup::BackupArgs),
    Restore(backup::RestoreArgs),
    Sniff(sniff::SniffArgs),
    Serve(serve::ServeArgs),
    View(view::ViewArgs),
    Class(class::ClassArgs),
    Servo(servo::ServoArgs),
    #[cfg(unix)]
    Sim(sim::SimArgs),
    Registers(registers::RegistersArgs),
    Model(model::ModelArgs),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

impl Command {
    pub(crate) fn run(self, session: &mut Session) -> Result<(), CommandError> {
        if session.log.is_some() && !self.opens_arm() {
            let reason =
                "--log writes what a command and an arm say to each other: this command opens no arm itself";
            return Err(CommandError::Usage(reason.to_owned()));
        }
        match self {
            Self::Ports(args) => ports::run(session, &args),
            Self::Info(_) => info::run(session),
            Self::Status(_) => status::run(session),
            Self::Recover(args) => recover::run(session, &args),
            Self::Get(args) => get::run(session, &args),
            Self::Set(args) => set::run(session, &args),
            Self::Pose(args) => pose::run(session, &args),
            Self::Home(args) => pose::home(session, &args),
            Self::Park(args) => park::run(session, &args),
            Self::Where(_) => position::run(session),
            Self::MoveTo(args) => move_to::run(session, &args),
            Self::Stop(args) => stop::run(session, &args),
            Self::State(args) => state::run(session, &args),
            Self::Vacuum(args) => effector::vacuum(session, &args),
            Self::Effector(args) => effector::effector(session, &args),
            Self::Monitor(args) => monitor::run(session, &args),
            Self::Log(args) => log::run(session, &args),
            Self::Record(args) => record::run(session, &args),
            Self::Play(args) => play::run(session, &args),
            Self::Stream(args) => stream::run(session, &args),
            Self::Convert(args) => convert::run(session, &args),
            Self::Plot(args) => plot::run(session, &args),
            Self::Calibrate(args) => calibrate::run(session, &args),
            Self::Baud(args) => baud::run(session, &args),
            Self::Backup(args) => backup::backup(session, &args),
            Self::Restore(args) => backup::restore(session, &args),
            Self::Sniff(args) => sniff::run(session, &args),
            Self::Serve(args) => serve::run(session, &args),
            Self::View(args) => view::run(session, &args),
            Self::Class(args) => class::run(session, &args),
            Self::Servo(args) => servo::run(session, &args),
            #[cfg(unix)]
            Self::Sim(args) => sim::run(session, &args),
            Self::Registers(args) => registers::run(session, &args),
            Self::Model(args) => model::run(&args),
            Self::Completions(args) => shell::completions(session, &args, Cli::command()),
            Self::Man(args) => shell::man(session, &args, Cli::command()),
        }
    }
}

impl Command {
    /// Does the command open an arm, so that `--log` has something to write? In `serve`, `view` and `class` a server opens it.
    const fn opens_arm(&self) -> bool {
        match self {
            Self::Ports(_) | Self::Plot(_) | Self::Sniff(_) | Self::Servo(_) | Self::Registers(_) => false,
            Self::Convert(_) | Self::Model(_) | Self::Completions(_) | Self::Man(_) => false,
            Self::Serve(_) | Self::View(_) | Self::Class(_) => false,
            #[cfg(unix)]
            Self::Sim(_) => false,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// clap breaks a line that is too long for the terminal, and puts the remaining words on a line of their own.
    #[test]
    fn the_help_fits_a_terminal_of_80_columns() {
        fn check(command: &clap::Command) {
            let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            for line in text.lines() {
                assert!(line.chars().count() <= 80, "{}: {line}", command.get_name());
            }
            command.get_subcommands().for_each(check);
        }
        check(&Cli::command());
    }

    fn parsed(arguments: &str) -> Result<Cli, String> {
        let arguments = ["sevenbot"].into_iter().chain(arguments.split(' ')).map(OsString::from);
        Cli::from_arguments(arguments).map_err(|error| error.to_string())
    }

    #[test]
    fn negative_values_are_no_options() {
        let cli = parsed("set offset.2 -5").expect("a value");
        assert!(matches!(cli.command, Command::Set(set::SetArgs { values, .. }) if values == [-5]));
        for (arguments, says) in [
            ("home --speed -3deg/s", "a speed from 0 to 100 steps"),
            ("home --time -1s --wait", "for '--time <STEPS|S>'"),
            ("play a.txt --speed -1x", "a factor from 0.1 to 10"),
            ("play a.txt --approach -1", "a number from 0.1 to 60"),
            ("monitor --hz -3", "-3 is not in 1..=50"),
            ("--timeout -1 info", "-1 is not in 1..=65535"),
            ("info --baud -9600", "-9600 is not in 1200..=4000000"),
        ] {
            let message = parsed(arguments).expect_err(arguments);
            assert!(message.contains(says), "{arguments}: {message}");
        }
    }

    #[test]
    fn the_standard_park_pose_is_not_kept() {
        let message = parsed("park --standard --keep").expect_err("nothing to keep");
        assert!(message.contains("'--standard' cannot be used with '--keep'"), "{message}");
    }

    #[test]
    fn what_is_no_whole_number_is_told_in_words() {
        for arguments in ["monitor --hz NaN", "servo set 3 max-torque 1.5", "log --seconds ten"] {
            let message = parsed(arguments).expect_err(arguments);
            assert!(message.contains(": use a whole number\n"), "{arguments}: {message}");
            assert!(message.starts_with("error: invalid value '"), "{arguments}: {message}");
        }
        let message = parsed("log --seconds 99999999999999999999").expect_err("too many");
        assert!(message.contains("'--seconds <N>': it is out of range"), "{message}");
    }
}
