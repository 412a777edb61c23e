//! The command line: options, exit statuses, and errors in one line. Scripts rely on all of it.

use std::path::PathBuf;

use clap::{ArgAction, ArgGroup, Parser};
use motion_core::servo_bus::TorqueCodes;
use protocol_core::registers::JOINTS;
use tracing::level_filters::LevelFilter;

use crate::eeprom::Eeprom;
use arm_sim::faults::ArmFault;
use arm_sim::usb_adapter::Latency;

/// The default chip id of a simulated arm: "SIM" and 1.
const DEFAULT_CHIP_ID: &str = "53494d000001";

const LESSON: &str = "\
THE FIRST MINUTE
  host-sim --link ./7bot           an arm behind ./7bot, until Ctrl-C
  sevenbot --port ./7bot pose 120 90 65 90 90 90 80
  sevenbot --port ./7bot monitor   watch it move there
  sevenbot --port ./7bot stop      hold it where it is; `home` moves it back
  host-sim --link ./7bot --trace   the same, with every frame as text
  host-sim --eeprom none --fault 3=missing
                                   no stored settings, and joint 3 does not
                                   answer
  host-sim --arms 3 --link ./7bot  three arms, behind ./7bot-1, ./7bot-2 and
                                   ./7bot-3
  In the source tree: cargo sim -- --link ./7bot, and cargo sevenbot --port
  ./7bot pose ...

  Any serial client can open the port, at any baud rate. The first line on
  standard output is 'ready <tty path>', as soon as the port can be opened; with
  --arms there is one such line for each arm, in their order. Everything else is
  on standard error.

THE ARM HAS WEIGHT
  Without torque, a loaded joint falls, and in state damping it sinks. After
  power-up a hand holds each joint until it has torque. With --fault
  arm=supported it never falls.

WHILE IT RUNS
  sevenbot sim fault 3=missing --for 2s  faults, a hand, a weight, power: see
                                         sevenbot sim --help
  The control socket is for this user only. Standard error shows its path. With
  --arms each arm has its own socket, with its number before the extension.
  docs/simulation.md describes the requests.

LOCKSTEP
  host-sim --lockstep 1000 --link ./7bot  for a client that asks and waits for
                                          the answer
  Virtual time goes on only while a byte is on the host line. Then it stands
  until the client sends its next byte: the same client gets the same bytes in
  every run, however long it thinks. After MS without a byte, time goes on by 1
  ms. A client that sleeps, or that waits for reports, waits for this time-out.

FAULTS
  3=missing                the servo of joint 3 has no power
  3=late, 3=late=MS        its answers are 30 ms late, or MS
  3=garbled, 3=garbled=N   each answer has a wrong checksum, or each Nth one
  3=stuck                  something keeps it from turning
  3=restarting=MS          it restarts each MS, and loses its torque
  2=wall=60                a wall at 60 degrees stops joint 2, from where the
                           joint is now
  2=wall=60/500            a soft one: it pushes back with 500 mN m for each
                           degree
  2=push=-300              a hand pushes joint 2 with 300 mN m, towards smaller
                           angles
  7=thing=30, 7=thing=30/100
                           a thing between the claws: they cannot close below
                           30 degrees of joint 7
  bus=echo                 the controller receives its own bytes
  supply=volts=V           the supply has V volts instead of 7.4; a servo
                           restarts below 4.5
  supply=dips=MS           each MS it falls to 3 V for 20 ms
  supply=off               the servos have no supply; the controller has its own
  flash=fails, flash=full  no settings can be stored
  line=loss=P%, line=corruption=P%, line=delay=MS
                           of the bytes on the host line
  arm=supported            no fault: a stand supports the arm, and it does not
                           fall
  arm=goal-starts-torque   in a servo that restarted, a goal switches torque on

MANY ARMS
  --arms N runs arms 1 to N in one process. If an option names a file, each arm
  has its own, with its number before the extension: --eeprom arm.bin keeps the
  settings of arm 2 in arm-2.bin. Chip ids are consecutive, starting with
  --chip-id. Faults and signals apply to all arms.

AN ARM OF THE MAKER
  host-sim --as-maker 2.1.4 --link ./7bot
                                   an arm as the maker ships it, to test a
                                   program against
  It has the maker's map 2.1, checks no value, says nothing of what it ignores,
  and has no status block. It sends text between its frames at start and with
  each alarm. Its settings are stored in 7bot/stock.bin.

REAL SERVOS
  host-sim --servos /dev/ttyUSB0 --link ./7bot
                                   the controller on this computer, real servos
                                   behind an adapter for bus servos; clients use
                                   ./7bot
  'ready' appears when the adapter's port is open. Standard error shows the
  servos that were found and statistics of the bus. If the adapter is unplugged,
  host-sim waits for it, and the arm holds. At the end the servos are damped, so
  that the arm sinks slowly; --hold-on-exit leaves them holding. Never connect a
  second controller to the same servos. An answer may arrive --usb-timeout later
  than on the wire. The default suits an adapter that collects bytes for 16 ms;
  goals do not wait for answers. With a shorter time, more questions are sent if
  a servo is missing. A time that is too short for the adapter loses answers. An
  FTDI adapter has a latency timer, 16 ms by default. host-sim sets it to 1 ms
  through its file in sysfs, which only root can write on most systems.
  ASYNC_LOW_LATENCY (setserial low_latency) is not set.

SERVOS ONLY
  host-sim --servos-only --link ./bus  seven servos, as behind a USB adapter
  host-sim --servos-only --link ./bus --usb-latency 1-20 --fault bus=echo --trace
  The port carries raw frames of the servo bus. The servos receive bytes only at
  their own baud rate, --servo-baud, so set the port to it. --trace prints the
  bytes on the wire. A fault has the number of its joint, from 1 to 7, even if
  --ids gives the joint's servo another id.

SIGNALS
  SIGHUP           a power cycle: RAM registers are lost, settings and the port
                   stay
  SIGUSR1          with --servos-only: unplugs the adapter, and plugs it in
                   again. The servos keep their power. Without the adapter, the
                   port and its link do not exist
  SIGUSR2          a restart of the controller only: the servos keep power,
                   torque and goals
  SIGINT, SIGTERM  the end

EXIT STATUS
  0   ended by a signal, or after --help, --version or an equal replay
  1   the operating system failed while the simulator ran, or a replay differs
  2   an option or a file cannot be used; standard error says why, in one line";

/// The ids of servos: one value of an option.
pub type Ids = Vec<u8>;

/// A simulated 7Bot V2 arm on a port that any serial client can open.
#[derive(Clone, Debug, Parser)]
#[command(version, about, after_help = LESSON)]
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

    /// The arm's chip id, 12 hexadecimal digits
    #[arg(long, value_name = "HEX", default_value = DEFAULT_CHIP_ID, value_parser = chip_id)]
    pub chip_id: [u8; 6],

    /// Listen for `sevenbot sim` on a unix socket at PATH; 'none' for no socket [default: 7bot/control-PID.sock in
    /// $XDG_RUNTIME_DIR, or in the state directory]
    #[arg(long, value_name = "PATH", conflicts_with_all = ["servos", "servos_only", "servo_socket"])]
    pub control: Option<PathBuf>,

    /// Let virtual time stand while the client thinks: see LOCKSTEP below. MS is a time-out in real time
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

    /// Run only the seven servos, for another controller to drive through a unix socket at PATH
    #[arg(
        long,
        value_name = "PATH",
        conflicts_with_all = ["arms", "link", "eeprom", "unpaced", "chip_id", "trace"]
    )]
    pub servo_socket: Option<PathBuf>,

    /// Drive real servos behind the USB adapter at PORT, /dev/ttyUSB0 for example: see REAL SERVOS below
    #[arg(long, value_name = "PORT", conflicts_with_all = ["arms", "faults", "servo_socket"])]
    pub servos: Option<PathBuf>,

    /// With --servos: how many milliseconds later than on the wire an answer may arrive
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

    /// With --servos-only: how many milliseconds the adapter gathers bytes, as 16 or 1-20
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
    /// The log level.
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

/// An error of clap in one line: its first sentence, its tip, and a reference to the help.
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
    fn the_help_fits_a_terminal_of_80_columns() {
        for line in LESSON.lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
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
