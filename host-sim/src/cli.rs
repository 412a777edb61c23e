//! The command line, which is a contract: options, exit statuses, one line an error.

use std::path::PathBuf;

use clap::{ArgAction, Parser};
use tracing::level_filters::LevelFilter;

use crate::eeprom::Eeprom;
use crate::faults::FaultAt;

/// The chip id of a simulated arm that was given none: "SIM", and 1.
const DEFAULT_CHIP_ID: &str = "53494d000001";

const LESSON: &str = "\
THE FIRST MINUTE
  host-sim --link ./7bot                       an arm behind ./7bot, until Ctrl-C
  sevenbot --port ./7bot pose 120 90 65 90 90 90 80
  sevenbot --port ./7bot monitor               watch it move there
  sevenbot --port ./7bot stop                  hold it where it is; `home` leads it back
  host-sim --link ./7bot --trace               the same, with every frame in words
  host-sim --eeprom none --fault 3=missing     no memory, and joint 3 does not answer
  host-sim --arms 3 --link ./7bot              three arms, behind ./7bot-1, ./7bot-2 and ./7bot-3
  In the source tree: cargo sim -- --link ./7bot, and cargo sevenbot --port ./7bot pose ...

  Any serial client can open the port; the baud rate it asks for does not matter. The first line on
  standard output is 'ready <tty path>', as soon as it can be opened; with --arms there is one such
  line for each arm, in their order. All else is on standard error.

MANY ARMS
  --arms N runs arms 1 to N in one process. Where an option names a file, each arm has its own, with
  its number before the extension: --eeprom arm.bin keeps the settings of arm 2 in arm-2.bin. Chip
  ids count on from --chip-id, faults befall all arms, and so do signals.

SIGNALS
  SIGHUP            a power cycle: RAM registers are lost, settings are kept, the port stays
  SIGINT, SIGTERM   a clean end

EXIT STATUS
  0   ended by a signal, or after --help or --version
  1   the operating system failed while the simulator ran
  2   an option or a file cannot be used; standard error says why, in one line";

/// A 7Bot V2 arm without the arm: any serial client can open the port it makes.
#[derive(Clone, Debug, Parser)]
#[command(version, about, after_help = LESSON)]
pub struct Options {
    /// Keep a symbolic link to the port at PATH while running
    #[arg(long, value_name = "PATH")]
    pub link: Option<PathBuf>,

    /// Keep the settings in FILE; 'none' forgets them [default: 7bot/eeprom.bin in the state directory,
    /// $XDG_STATE_HOME or ~/.local/state]
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

    /// Print every frame in words on standard error
    #[arg(long)]
    pub trace: bool,

    /// Give the arm a fault (repeatable): JOINT from 1 to 7 and missing, stuck, late, late=MILLISECONDS,
    /// garbled or garbled=EVERY_NTH; or bus=echo
    #[arg(long = "fault", value_name = "JOINT=KIND")]
    pub faults: Vec<FaultAt>,

    /// Run only the seven servos, for another controller to drive through a unix socket at PATH
    #[arg(
        long,
        value_name = "PATH",
        conflicts_with_all = ["arms", "link", "eeprom", "unpaced", "chip_id", "trace"]
    )]
    pub servo_socket: Option<PathBuf>,

    /// Say more on standard error; twice: everything
    #[arg(short, long, action = ArgAction::Count, conflicts_with = "quiet")]
    pub verbose: u8,

    /// Say only what went wrong
    #[arg(short, long)]
    pub quiet: bool,
}

impl Options {
    /// How much to say.
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

/// Twelve hexadecimal digits, most significant first.
fn chip_id(text: &str) -> Result<[u8; 6], &'static str> {
    const WANTED: &str = "use exactly 12 hexadecimal digits, for example 53494d000001";
    if text.len() != 12 || !text.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return Err(WANTED);
    }
    let number = u64::from_str_radix(text, 16).map_err(|_| WANTED)?;
    let [_, _, id @ ..] = number.to_be_bytes();
    Ok(id)
}

/// What clap says about a wrong command line, in one line: its first sentence, its tip, and where to look.
#[must_use]
pub fn in_one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let mut words = text.lines().map(str::trim);
    let first = words.next().unwrap_or_default().trim_start_matches("error: ");
    let tip = words.find(|line| line.starts_with("tip: ")).map(|tip| format!(" ({tip})")).unwrap_or_default();
    format!("{first}{tip}; see host-sim --help")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(arguments: &str) -> Result<Options, clap::Error> {
        Options::try_parse_from(std::iter::once("host-sim").chain(arguments.split_whitespace()))
    }

    #[test]
    fn the_command_line_is_sound() {
        <Options as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn every_option_is_understood() {
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
    fn what_is_wrong_is_said_in_one_line() {
        for (arguments, says) in [
            ("--eprom x", "--eeprom"),
            ("--chip-id 12", "exactly 12 hexadecimal digits"),
            ("--chip-id +23456789012", "exactly 12 hexadecimal digits"),
            ("--fault 9=missing", "1 to 7"),
            ("--fault 3=broken", "missing"),
            ("--servo-socket a --link b", "--link"),
            ("--servo-socket a --arms 2", "--arms"),
            ("--arms 0", "--arms"),
            ("-q -v", "--verbose"),
            ("port", "port"),
        ] {
            let line = in_one_line(&parse(arguments).unwrap_err());
            assert!(line.contains(says) && line.contains("--help") && !line.contains('\n'), "{line}");
        }
    }
}
