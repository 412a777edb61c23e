//! `baud`: shows, changes or finds the baud rate of an arm.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;
use sevenbot::map::{BAUD_RATE, BAUD_RATES, baud_rate};
use sevenbot::{Arm, Map, OpenError, Span, ports};

use crate::command_error::CommandError;
use crate::interrupt::hold_on_interrupt;
use crate::printer::{Printable, note};
use crate::session::Session;

/// Show, change or find the baud rate of the arm.
#[derive(Debug, Args)]
#[command(after_help = "\
A new rate applies after the next restart of the arm.

Examples:
  sevenbot baud  the rate in use, and the one after a restart
  sevenbot baud 1000000
  sevenbot --port /dev/ttyUSB0 baud --find
                 tries all eight rates")]
pub(crate) struct BaudArgs {
    /// The rate after the next restart.
    #[arg(value_parser = rate)]
    rate: Option<u32>,
    /// Find the present rate of the arm.
    #[arg(long, conflicts_with = "rate")]
    find: bool,
}

fn rate(text: &str) -> Result<u32, String> {
    let known = text.parse().ok().filter(|rate| BAUD_RATES.contains(rate));
    known.ok_or_else(|| {
        let mut rates = BAUD_RATES;
        rates.sort_unstable();
        format!("the arm supports {}", rates.map(|rate| rate.to_string()).join(", "))
    })
}

#[derive(Serialize)]
struct BaudRates {
    baud: u32,
    baud_after_restart: u32,
}

impl Printable for BaudRates {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let Self { baud, baud_after_restart } = self;
        writeln!(out, "now            {baud} baud")?;
        writeln!(out, "after restart  {baud_after_restart} baud")
    }
}

pub(crate) fn run(session: &mut Session, args: &BaudArgs) -> Result<(), CommandError> {
    let mut arm = if args.find { find(session)? } else { session.connect()? };
    let baud = arm.options().baud;
    if let Some(rate) = args.rate {
        let code = (0..).zip(BAUD_RATES).find(|&(code, known)| known == rate && has_baud_code(&arm, code));
        let (code, _) = code.ok_or_else(|| {
            CommandError::Usage(format!("the maker's firmware supports 115200 and 1000000 baud, not {rate}"))
        })?;
        let write = |arm: &mut Arm| arm.write_checked(BAUD_RATE.address, &[code]);
        // Ctrl-C must not leave the EEPROM lock open.
        hold_on_interrupt(&mut arm, |arm, _| Ok(arm.with_open_lock(write)?))?;
    }
    let code = arm.read_span(Span::of(&BAUD_RATE))?.byte(&BAUD_RATE);
    let baud_after_restart = baud_rate(if has_baud_code(&arm, code) { code } else { 0 });
    session.printer.print(&BaudRates { baud, baud_after_restart })?;
    if args.rate.is_some() && baud != baud_after_restart {
        note(format_args!(
            "switch the arm off and on, then use --baud {baud_after_restart}; until then use --baud {baud}"
        ));
    } else if args.find {
        note(format_args!("use --baud {baud} from now on"));
    }
    Ok(())
}

/// Does this arm support the rate with this code? The maker's firmware with map 2.1 supports 115200 and 1000000 baud, and
/// treats the other codes as 0.
fn has_baud_code(arm: &Arm, code: u8) -> bool {
    arm.identity().map() == Map::V22 || matches!(baud_rate(code), 115_200 | 1_000_000)
}

fn find(session: &Session) -> Result<Arm, CommandError> {
    let port = session.port.clone().ok_or_else(|| {
        CommandError::Usage("--find needs --port: it would send to every device of this machine".to_owned())
    })?;
    let tell = |baud| note(format_args!("trying {baud} baud"));
    ports::find_baud(&port, tell).map_err(|error| match error {
        OpenError::Silent(_) => CommandError::NoRate { port },
        error => CommandError::Open { port, error },
    })
}
