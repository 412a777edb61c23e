//! The serial ports of this machine, the servers of this user, and which of them lead to an arm.

use std::fs;
use std::thread;
use std::time::Duration;

use protocol_core::registers::map::{BAUD_RATES, DEVICE_ID};
use serialport::SerialPortType;

use crate::arm::Arm;
use crate::arm_options::ArmOptions;
use crate::error::OpenError;
use crate::identity::Identity;
use crate::network::{Address, LocalServer, servers};
use host_link::Span;

/// The timeout of one attempt. A read of eight registers takes 2 ms at 115,200 baud and 23 ms at 9,600 baud. USB adapters add
/// up to 16 ms in each direction.
const PROBE_TIMEOUT: Duration = Duration::from_millis(200);
/// More than one attempt, because a port may first deliver garbage after it was opened.
const PROBE_ATTEMPTS: u32 = 2;

/// A serial port of this machine, or a server of this user.
///
/// ```no_run
/// for port in sevenbot::ports::available() {
///     println!("{} {}", port.name, port.description);
/// }
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// The name to open it by.
    pub name: String,
    /// The system's description of the device, which may be empty; of a server, the serial port of its arm.
    pub description: String,
}

/// The result of asking one port.
///
/// ```no_run
/// let found = sevenbot::ports::probe(sevenbot::ports::available(), 115_200);
/// let arms = found.iter().filter(|found| found.answer.is_ok());
/// println!("{} arms", arms.count());
/// ```
#[derive(Debug)]
pub struct ProbeResult {
    /// The serial port, or the server, that was asked.
    pub port: PortInfo,
    /// The arm's identity and device id (register 11), or why there is none.
    pub answer: Result<(Identity, u8), OpenError>,
}

/// The serial ports that the system lists. Pseudo-terminals, such as a simulator's, are not listed.
#[must_use]
pub fn available() -> Vec<PortInfo> {
    let mut ports: Vec<PortInfo> =
        serialport::available_ports().unwrap_or_default().into_iter().map(port).collect();
    ports.sort_by(|one, other| one.name.cmp(&other.name));
    // macOS lists each port twice. The tty one waits for a carrier signal, which an arm does not give.
    if cfg!(target_os = "macos") {
        ports.retain(|port| !port.name.starts_with("/dev/tty."));
    }
    ports
}

/// The servers of this user, and the serial ports that none of them holds, so that each arm is listed once. [`probe`] takes
/// this list.
#[must_use]
pub fn reachable() -> Vec<PortInfo> {
    let served = servers();
    let is_held = |port: &PortInfo| {
        fs::canonicalize(&port.name).is_ok_and(|path| served.iter().any(|server| server.port == path))
    };
    let free = available().into_iter().filter(|port| !is_held(port));
    served.iter().map(served_port).chain(free).collect()
}

/// A server in the list of ports.
fn served_port(server: &LocalServer) -> PortInfo {
    let port = server.port.display();
    match &server.name {
        Some(name) => PortInfo {
            name: format!("sevenbot://{name}"),
            description: format!("{}, for {port}", server.address()),
        },
        None => PortInfo { name: server.address(), description: format!("for {port}") },
    }
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

/// Asks all these ports at the same time for an arm.
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
    let mut arm = match Address::parse(name) {
        // Through a server, replies may have to wait for replies to other programs. So the timeout is the longer default.
        Some(_) => Arm::open_with(name, ArmOptions { baud, ..ArmOptions::default() })?,
        None => open_quickly(name, baud)?,
    };
    let device_id = arm.read_span(Span::of(&DEVICE_ID))?.byte(&DEVICE_ID);
    Ok((arm.identity().clone(), device_id))
}

fn open_quickly(name: &str, baud: u32) -> Result<Arm, OpenError> {
    let options = ArmOptions { baud, reply_timeout: PROBE_TIMEOUT, attempts: PROBE_ATTEMPTS, map: None };
    Arm::open_with(name, options)
}

/// Finds the arm's baud rate by trying all eight (register 12).
///
/// Calls `on_rate` with each rate before trying it.
///
/// # Errors
/// The arm answers at no rate: the error of the last rate. Or the port cannot be opened, or another device answers.
pub fn find_baud(name: &str, mut on_rate: impl FnMut(u32)) -> Result<Arm, OpenError> {
    let mut last = OpenError::NotFound;
    for baud in BAUD_RATES {
        on_rate(baud);
        match open_quickly(name, baud) {
            Ok(arm) => return Ok(arm),
            // An adapter may not support a rate.
            Err(error @ (OpenError::Silent(_) | OpenError::Unusable(_))) => last = error,
            Err(error) => return Err(error),
        }
    }
    Err(last)
}
