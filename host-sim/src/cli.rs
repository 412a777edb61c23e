//! The command line: its options, and its errors in one line. Scripts rely on both.

use std::path::PathBuf;

use clap::{ArgAction, ArgGroup, Parser};
use motion_core::servo_bus::TorqueCodes;
use protocol_core::registers::JOINTS;
use tracing::level_filters::LevelFilter;

use crate::eeprom::Eeprom;
use crate::help::lesson;
use arm_sim::faults::ArmFault;
use arm_sim::scene::{Scene, SceneError};
use arm_sim::usb_adapter::Latency;

/// The default chip id of a simulated arm: "SIM" and 1.
const DEFAULT_CHIP_ID: &str = "53494d000001";

/// The ids of servos. With this alias, clap takes a list of ids as one value of an option.
pub type Ids = Vec<u8>;

/// The version. `cargo xtask dist` adds the commit.
const VERSION: &str = match option_env!("SEVENBOT_RELEASE") {
    Some(release) => release,
    None => env!("CARGO_PKG_VERSION"),
};

/// A simulated 7Bot V2 arm on a port that any serial client can open.
#[derive(Clone, Debug, Parser)]
#[command(version = VERSION, about, after_help = lesson())]
#[command(group = ArgGroup::new("adapter").args(["servos", "servos_only"]))]
pub struct Options {
    /// Keep a symbolic link to the port at PATH while running
    #[arg(long, value_name = "PATH")]
    pub link: Option<PathBuf>,

    /// Keep the settings in FILE; 'none' forgets them [default: 7bot/eeprom.bin, 7bot/servos.bin with
    /// --servos, or 7bot/stock.bin with --as-maker, in the state directory, $XDG_STATE_HOME or ~/.local/state]
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Ok::<_, String>(Eeprom::from(text)))]
    pub eeprom: Option<Eeprom>,

    /// Run N arms, each with its own port, settings and chip id: see MANY ARMS below
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub arms: Option<u16>,

    /// Let bytes pass at once instead of at the baud rate
    #[arg(long)]
    pub unpaced: bool,

    /// Hear and answer only clients at the arm's baud rate (register 12), as a serial line does
    #[arg(long, conflicts_with_all = ["servos", "servos_only", "servo_socket"])]
    pub strict_baud: bool,

    /// The arm's chip id, 12 hexadecimal digits
    #[arg(long, value_name = "HEX", default_value = DEFAULT_CHIP_ID, value_parser = chip_id)]
    pub chip_id: [u8; 6],

    /// Listen for `sevenbot sim` on a unix socket at PATH; 'none' for no socket [default: 7bot/control-PID.sock in
    /// $XDG_RUNTIME_DIR, or in the state directory]
    #[arg(long, value_name = "PATH", conflicts_with_all = ["servos", "servos_only", "servo_socket"])]
    pub control: Option<PathBuf>,

    /// Stop virtual time while the client computes: see LOCKSTEP below. MS is a timeout in real time
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..=86_400_000),
          conflicts_with_all = ["arms", "servos", "servos_only", "servo_socket"])]
    pub lockstep: Option<u32>,

    /// Be an arm as the maker ships it, with the maker's firmware of this version: see AN ARM OF THE MAKER below
    #[arg(long, value_name = "VERSION", value_parser = maker_version,
          conflicts_with_all = ["servos", "servos_only", "servo_socket"])]
    pub as_maker: Option<String>,

    /// Record the session to FILE: every byte, every fault and their virtual times
    #[arg(long, value_name = "FILE", conflicts_with_all = ["servos", "servos_only", "servo_socket"])]
    pub record: Option<PathBuf>,

    /// With --record: replace FILE if it exists
    #[arg(long, requires = "record")]
    pub force: bool,

    /// Replay a recorded session in virtual time, and end: status 1 and the first difference if the arm sends
    /// something else
    #[arg(long, value_name = "FILE", exclusive = true)]
    pub replay: Option<PathBuf>,

    /// Print every frame in words on standard error
    #[arg(long)]
    pub trace: bool,

    /// Give the arm a fault (repeatable): see FAULTS below
    #[arg(long = "fault", value_name = "JOINT=KIND")]
    pub faults: Vec<ArmFault>,

    /// Put the scene in FILE on the table: cubes, cylinders and walls, see docs/simulation.md
    #[arg(long, value_name = "FILE", value_parser = scene, conflicts_with_all = ["servos", "servo_socket", "servos_only"])]
    pub scene: Option<Scene>,

    /// Run only the seven servos, for another controller to drive through a unix socket at PATH
    #[arg(
        long,
        value_name = "PATH",
        conflicts_with_all = ["arms", "link", "eeprom", "unpaced", "chip_id", "trace"]
    )]
    pub servo_socket: Option<PathBuf>,

    /// With --servo-socket: write the true angles of the joints to this file, each 10 ms with the seconds since 1970
    #[arg(long, value_name = "FILE", requires = "servo_socket")]
    pub angles: Option<PathBuf>,

    /// Drive real servos behind the USB adapter at PORT, /dev/ttyUSB0 for example: see REAL SERVOS below
    #[arg(long, value_name = "PORT", conflicts_with_all = ["arms", "faults", "servo_socket"])]
    pub servos: Option<PathBuf>,

    /// With --servos: how much later than on the wire an answer may arrive, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 40, requires = "servos", value_parser = clap::value_parser!(u16).range(0..=1_000))]
    pub usb_timeout: u16,

    /// With --servos: at the end leave the servos holding instead of damping them
    #[arg(long, requires = "servos")]
    pub hold_on_exit: bool,

    /// Run only the servos, on a port that carries the servo bus as a USB adapter does: see SERVOS ONLY below
    #[arg(long, conflicts_with_all = ["arms", "eeprom", "unpaced", "chip_id", "servo_socket"])]
    pub servos_only: bool,

    /// With --servos-only: the servos' ids, seven at most; joint n has id n-1 [default: 0,1,2,3,4,5,6]
    #[arg(long, value_name = "ID,..", value_parser = ids, requires = "servos_only")]
    pub ids: Option<Ids>,

    /// With --servos-only: the milliseconds for which the adapter gathers bytes, such as 16 or 1-20
    #[arg(long, value_name = "MS", default_value = "0", requires = "servos_only")]
    pub usb_latency: Latency,

    /// The seed of all random values: line faults, and with --servos-only the delays of the adapter
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with_all = ["servos", "servo_socket"])]
    pub seed: u64,

    /// The baud rate of the servo bus
    #[arg(long, value_name = "BAUD", default_value_t = 1_000_000, requires = "adapter")]
    pub servo_baud: u32,

    /// What a servo's register 40 means: 'older' is 0 damping, 1 on, 2 free; 'current' is 0 free, 1 on, 2 damping
    #[arg(long, value_name = "TABLE", default_value = "older", value_parser = torque_codes)]
    pub torque_codes: TorqueCodes,

    /// Say more on standard error; twice: everything
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "quiet")]
    pub verbose: u8,

    /// Say only what went wrong
    #[arg(short, long)]
    pub quiet: bool,
}

impl Options {
    /// The log level: warnings with `--quiet`, otherwise more with each `--verbose`.
    #[must_use]
    pub const fn level(&self) -> LevelFilter {
        match (self.quiet, self.verbose) {
            (true, _) => LevelFilter::WARN,
            (false, 0) => LevelFilter::INFO,
            (false, 1) => LevelFilter::DEBUG,
            (false, _) => LevelFilter::TRACE,
        }
    }
}

/// Parses up to seven ids of servos, separated by commas. Ids may repeat.
fn ids(text: &str) -> Result<Ids, &'static str> {
    let ids: Option<Ids> = text.split(',').map(|id| id.parse().ok().filter(|&id| id <= 253)).collect();
    ids.filter(|ids| ids.len() <= JOINTS).ok_or("use up to seven ids from 0 to 253, as 0,1,2")
}

/// Reads and parses the file of a scene.
fn scene(path: &str) -> Result<Scene, String> {
    std::fs::read_to_string(path)
        .map_err(|why| why.to_string())?
        .parse()
        .map_err(|why: SceneError| why.to_string())
}

/// Parses the name of one of the two published tables of register 40.
fn torque_codes(word: &str) -> Result<TorqueCodes, &'static str> {
    match word {
        "older" => Ok(TorqueCodes::DampingOnFree),
        "current" => Ok(TorqueCodes::FreeOnDamping),
        _ => Err("use older (0 damping, 1 on, 2 free) or current (0 free, 1 on, 2 damping)"),
    }
}

/// Parses the version of the maker's firmware.
fn maker_version(text: &str) -> Result<String, &'static str> {
    if text == "2.1.4" { Ok(text.to_owned()) } else { Err("use 2.1.4, the only version that is simulated") }
}

/// Parses twelve hexadecimal digits, most significant first.
fn chip_id(text: &str) -> Result<[u8; 6], &'static str> {
    const WANTED: &str = "use exactly 12 hexadecimal digits, for example 53494d000001";
    if text.len() != 12 || !text.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return Err(WANTED);
    }
    let number = u64::from_str_radix(text, 16).map_err(|_| WANTED)?;
    let [_, _, id @ ..] = number.to_be_bytes();
    Ok(id)
}

/// An error of clap in one line: its first line, its tip, and a reference to the help.
#[must_use]
pub fn in_one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let mut words = text.lines().map(str::trim);
    let first = words.next().unwrap_or_default().trim_start_matches("error: ");
    // clap puts lists on separate lines.
    let listed = if first.ends_with(':') { words.next().unwrap_or_default() } else { "" };
    let space = if listed.is_empty() { "" } else { " " };
    let tip = words.find(|line| line.starts_with("tip: ")).map(|tip| format!(" ({tip})")).unwrap_or_default();
    format!("{first}{space}{listed}{tip}; see host-sim --help")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &str) -> Result<Options, clap::Error> {
        Options::try_parse_from(std::iter::once("host-sim").chain(arguments.split_whitespace()))
    }

    #[test]
    fn the_command_line_is_consistent() {
        <Options as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn every_option_is_parsed() {
        let options = parse("--link a --eeprom none --unpaced --chip-id 0123456789AB --trace -vv").unwrap();
        assert_eq!(options.chip_id, [0x01, 0x23, 0x45, 0x67, 0x89, 0xAB]);
        assert_eq!(options.eeprom, Some(Eeprom::Memory));
        assert_eq!(options.level(), LevelFilter::TRACE);
        let options = parse("--fault 3=missing --fault bus=echo -q").unwrap();
        assert_eq!(options.faults.len(), 2);
        assert_eq!(options.level(), LevelFilter::WARN);
        assert_eq!(parse("").unwrap().chip_id, *b"SIM\0\0\x01");
        assert_eq!(parse("--arms 1000").unwrap().arms, Some(1_000));
    }

    #[test]
    fn errors_are_in_one_line() {
        for (arguments, says) in [
            ("--eprom x", "--eeprom"),
            ("--chip-id 12", "exactly 12 hexadecimal digits"),
            ("--chip-id +23456789012", "exactly 12 hexadecimal digits"),
            ("--fault 9=missing", "1 to 7"),
            ("--fault 3=broken", "missing"),
            ("--servo-socket a --link b", "--link"),
            ("--servo-socket a --arms 2", "--arms"),
            ("--servos-only --arms 2", "--arms"),
            ("--servos-only --eeprom none", "--eeprom"),
            ("--servos-only --usb-latency 20-1", "1-20"),
            ("--servos-only --ids 0,254", "0 to 253"),
            ("--servos-only --ids 0,1,2,3,4,5,6,7", "seven"),
            ("--usb-latency 1", "--servos-only"),
            ("--as-maker 2.2", "2.1.4"),
            ("--as-maker 2.1.4 --servos a", "--servos"),
            ("--servos a --arms 2", "--arms"),
            ("--servos a --control b", "--control"),
            ("--lockstep 10 --arms 2", "--arms"),
            ("--lockstep 0", "--lockstep"),
            ("--servos a --fault 3=missing", "--fault"),
            ("--servos a --servos-only", "--servos-only"),
            ("--hold-on-exit", "--servos"),
            ("--force", "--record"),
            ("--servo-baud 1000", "--servos"),
            ("--torque-codes new", "older"),
            ("--arms 0", "--arms"),
            ("-q -v", "--verbose"),
            ("port", "port"),
        ] {
            let line = in_one_line(&parse(arguments).unwrap_err());
            assert!(line.contains(says) && line.contains("--help") && !line.contains('\n'), "{line}");
        }
    }
}
