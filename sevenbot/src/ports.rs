//! The serial ports of this machine, and which of them lead to an arm.
//!
//! Knows how to ask a stranger who it is, quickly; what to make of the answer is the caller's.

use std::thread;
use std::time::Duration;

use protocol_core::registers::map::{BAUD_RATES, DEVICE_ID};
use serialport::SerialPortType;

use crate::arm::{Arm, ArmOptions};
use crate::error::OpenError;
use crate::identity::Identity;
use crate::span::Span;

/// How long an arm may take to say who it is: eight registers take 2 ms at 115 200 baud and 25 ms at 9600,
/// USB adapters add up to 16 ms each way, and an arm's own work little.
const PROBE_TIMEOUT: Duration = Duration::from_millis(200);
/// A port that just opened may bring rubbish first.
const PROBE_ATTEMPTS: u32 = 2;

/// A serial port of this machine.
///
/// ```no_run
/// for port in sevenbot::ports::available() {
///     println!("{} {}", port.name, port.description);
/// }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// What to open it by.
    pub name: String,
    /// What it is plugged into, in the system's words; empty where those are none.
    pub description: String,
}

/// What was found behind a port.
///
/// ```no_run
/// let found = sevenbot::ports::probe(sevenbot::ports::available(), 115_200);
/// let arms = found.iter().filter(|found| found.answer.is_ok());
/// println!("{} arms", arms.count());
/// ```
#[derive(Debug)]
pub struct ProbeResult {
    /// The port.
    pub port: PortInfo,
    /// Who answered there, with the number its user gave it; or why nobody did.
    pub answer: Result<(Identity, u8), OpenError>,
}

/// The serial ports the system knows of. Pseudo-terminals, such as a simulator's, are not among them.
#[must_use]
pub fn available() -> Vec<PortInfo> {
    let mut ports: Vec<PortInfo> =
        serialport::available_ports().unwrap_or_default().into_iter().map(port).collect();
    ports.sort_by(|one, other| one.name.cmp(&other.name));
    // macOS has each port twice: tty waits for a carrier that no arm raises, cu does not.
    if cfg!(target_os = "macos") {
        ports.retain(|port| !port.name.starts_with("/dev/tty."));
    }
    ports
}

fn port(info: serialport::SerialPortInfo) -> PortInfo {
    let description = match info.port_type {
        SerialPortType::UsbPort(usb) => {
            let words = [usb.manufacturer, usb.product].into_iter().flatten().collect::<Vec<_>>().join(" ");
            format!("USB {:04x}:{:04x} {words}", usb.vid, usb.pid).trim_end().to_owned()
        }
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::PciPort => "PCI".to_owned(),
        SerialPortType::Unknown => String::new(),
    };
    PortInfo { name: info.port_name, description }
}

/// Asks all these ports at once who is there.
///
/// ```no_run
/// for found in sevenbot::ports::probe(sevenbot::ports::available(), 115_200) {
///     match found.answer {
///         Ok((identity, id)) => println!("{}: arm {id}, {}", found.port.name, identity.version()),
///         Err(reason) => println!("{}: {reason}", found.port.name),
///     }
/// }
/// ```
#[must_use]
pub fn probe(ports: Vec<PortInfo>, baud: u32) -> Vec<ProbeResult> {
    let ask = |port: PortInfo| thread::spawn(move || ProbeResult { answer: ask(&port.name, baud), port });
    let asked: Vec<_> = ports.into_iter().map(ask).collect();
    asked.into_iter().filter_map(|thread| thread.join().ok()).collect()
}

fn ask(name: &str, baud: u32) -> Result<(Identity, u8), OpenError> {
    let mut arm = open_quickly(name, baud)?;
    let device_id = arm.read_span(Span::of(&DEVICE_ID))?.byte(&DEVICE_ID);
    Ok((arm.identity().clone(), device_id))
}

fn open_quickly(name: &str, baud: u32) -> Result<Arm, OpenError> {
    Arm::open_with(name, ArmOptions { baud, reply_timeout: PROBE_TIMEOUT, attempts: PROBE_ATTEMPTS })
}

/// Finds the baud rate an arm listens at, by trying all eight of them (register 12).
///
/// `tell` is told each rate before it is tried.
///
/// # Errors
/// None of them is answered: what the last one brought. A port that does not open at all ends the search.
pub fn find_baud(name: &str, mut tell: impl FnMut(u32)) -> Result<Arm, OpenError> {
    let mut last = OpenError::NotFound;
    for baud in BAUD_RATES {
        tell(baud);
        match open_quickly(name, baud) {
            Ok(arm) => return Ok(arm),
            // An adapter may not know a rate; the next one may do.
            Err(error @ (OpenError::Silent(_) | OpenError::Unusable(_))) => last = error,
            Err(error) => return Err(error),
        }
    }
    Err(last)
}
