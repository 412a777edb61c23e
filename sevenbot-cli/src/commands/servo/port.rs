//! The adapter's port, arguments that subcommands share, and the error of a failed exchange.

use clap::{Args, builder::RangedI64ValueParser, value_parser};
use sevenbot::servo_bench::{BAUD_RATES, BusMaster, BusOptions, MAX_ID, ServoError};
use sevenbot::simulated::simulated_port;
use sevenbot::{Arm, ArmOptions, ReceiveCounts, ports};

use crate::command_error::CommandError;
use crate::session::{Session, check_is_no_server};

/// The baud rate of the bus.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Rate {
    /// Baud rate of the servo bus.
    #[arg(long, value_name = "RATE", default_value_t = 1_000_000, value_parser = rate)]
    pub(super) rate: u32,
}

/// Parses one of the eight rates of an SCS servo.
pub(super) fn rate(text: &str) -> Result<u32, String> {
    let known = text.parse().ok().filter(|rate| BAUD_RATES.contains(rate));
    known.ok_or_else(|| format!("servos support {}", BAUD_RATES.map(|rate| rate.to_string()).join(", ")))
}

/// An id that a servo can have.
pub(super) fn id() -> RangedI64ValueParser<u8> {
    value_parser!(u8).range(..=i64::from(MAX_ID))
}

/// The adapter's port. It must be given: a search would send bytes to other devices.
pub(super) fn port(session: &Session) -> Result<String, CommandError> {
    let usage = |text: &str| CommandError::Usage(text.to_owned());
    let how = "`sevenbot servo` needs the adapter's port: use --port PORT or set SEVENBOT_PORT";
    let port = session.port.clone().ok_or_else(|| usage(how))?;
    if simulated_port(&port).is_some() {
        return Err(usage(
            "--port sim has no servo bus: start `host-sim --servos-only --link ./bus`, and use --port ./bus",
        ));
    }
    check_is_no_server(&port)?;
    Ok(port)
}

/// Opens the adapter's port. `baud` is the rate of the servo bus.
pub(super) fn open(session: &Session, baud: u32) -> Result<BusMaster, CommandError> {
    let port = port(session)?;
    let options = BusOptions { reply_timeout: session.options.reply_timeout, ..BusOptions::default() };
    BusMaster::open(&port, baud, options).map_err(|error| CommandError::Open { port, error })
}

/// The error of a failed exchange. If no frame was received, checks whether the port is an arm's host link. Tries only the --baud
/// of this command: all rates would take seconds.
pub(super) fn exchange_error(session: &Session, bus: BusMaster, error: ServoError) -> CommandError {
    let is_silent = matches!(
        error,
        ServoError::NoAnswer { received: ReceiveCounts { other_frames: 0, damaged_frames: 0, .. }, .. }
    );
    match port(session) {
        Err(failure) => failure,
        Ok(port) if is_silent && is_host_link(session, bus, &port) => CommandError::HostLink { port },
        Ok(port) => CommandError::Servo { port, error },
    }
}

/// Does the controller of an arm answer on this port, at any baud rate?
pub(super) fn leads_to_arm(session: &Session, bus: BusMaster, port: &str) -> bool {
    is_host_link(session, bus, port) || ports::find_baud(port, |_| ()).is_ok()
}

/// Does the controller of an arm answer on this port, at the baud rate of this command?
fn is_host_link(session: &Session, bus: BusMaster, port: &str) -> bool {
    // The port can be opened only once.
    drop(bus);
    let patient = ArmOptions { attempts: 1, ..session.options };
    Arm::open_with(port, patient).is_ok()
}
