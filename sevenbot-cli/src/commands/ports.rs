//! `ports`: lists serial ports, servers and simulators, and the arms behind them; remembers and forgets names of the network.

use std::fs;
use std::io::{self, Write};

use clap::Args;
use serde::Serialize;
use sevenbot::network::{self, Address, KnownName, mdns};
use sevenbot::ports::{PortInfo, ProbeResult, probe, reachable};

use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::session::{Session, running_simulators};
use crate::style::GOOD;

/// List serial ports, servers and simulators, and the arms behind them.
#[derive(Debug, Args)]
#[command(after_help = "\
Opens all ports at the same time and asks each for its device code. Other
devices receive 14 bytes. Lists the servers and simulators of this user, too; an
arm that `sevenbot serve` holds is found through its server.

Examples:
  sevenbot ports
  sevenbot ports /dev/ttyUSB0 ./7bot     only these, also unlisted ones
  sevenbot ports --network
  sevenbot ports --remember lab-3=tls://10.0.0.5:7777")]
pub(crate) struct PortsArgs {
    /// Ask only these ports.
    #[arg(value_name = "PORT")]
    ports: Vec<String>,
    /// Ask the local network for the names of arms, too, and list those that are known. It takes a second and a half.
    #[arg(long)]
    network: bool,
    /// Remember the address of an arm on the network, for --port sevenbot://NAME: for networks that block multicast.
    #[arg(long, value_name = "NAME=ADDRESS", value_parser = known_name)]
    remember: Option<KnownName>,
    /// Forget the address of a name.
    #[arg(long, value_name = "NAME", conflicts_with = "remember")]
    forget: Option<String>,
}

pub(crate) fn run(session: &mut Session, args: &PortsArgs) -> Result<(), CommandError> {
    if let Some(known) = &args.remember {
        return Ok(network::remember(known)?);
    }
    if let Some(name) = &args.forget {
        return forget(name);
    }
    let named = args.ports.iter().chain(&session.port);
    let named = named.map(|name| PortInfo { name: name.clone(), description: String::new() });
    let mut asked = if args.ports.is_empty() { reachable() } else { Vec::new() };
    let simulators = if args.ports.is_empty() { free_simulators() } else { Vec::new() };
    for port in named.chain(simulators) {
        if asked.iter().all(|known| !is_same(&known.name, &port.name)) {
            asked.push(port);
        }
    }
    let of_network = if args.network { names_of_network() } else { Vec::new() };
    let ports =
        probe(asked, session.options.baud).into_iter().map(PortLine::from).chain(of_network).collect();
    session.printer.print(&Ports { ports })
}

fn forget(name: &str) -> Result<(), CommandError> {
    let was_known = network::known_names().iter().any(|known| known.name == name);
    network::forget(name)?;
    let how = "`sevenbot ports --network` lists the names";
    if was_known { Ok(()) } else { Err(CommandError::Arm(format!("{name} is not a known name: {how}"))) }
}

/// The simulators of this user that no server holds.
fn free_simulators() -> Vec<PortInfo> {
    let free = running_simulators().into_iter().filter(|port| network::serving(port).is_none());
    free.map(|name| PortInfo { name, description: "simulator".to_owned() }).collect()
}

/// Do both names lead to the same port? A simulator has a link beside its port.
fn is_same(one: &str, other: &str) -> bool {
    one == other
        || fs::canonicalize(one).is_ok_and(|path| fs::canonicalize(other).is_ok_and(|other| path == other))
}

/// Parses `NAME=ADDRESS`.
fn known_name(text: &str) -> Result<KnownName, String> {
    let (name, address) =
        text.split_once('=').ok_or("write NAME=ADDRESS, such as lab-3=tls://10.0.0.5:7777")?;
    let address = Address::parse(address).filter(Address::is_of_network);
    let address = address.ok_or("the address: use tcp://HOST:PORT or tls://HOST:PORT")?;
    let name = Some(name).filter(|name| network::is_name(name)).ok_or(network::NAME_RULE)?.to_owned();
    Ok(KnownName { name, address })
}

/// Lines for the servers of the local network: those that are announced now, then the other known ones. No request is sent to
/// them, because they may require a token.
fn names_of_network() -> Vec<PortLine> {
    let announced: Vec<KnownName> = mdns::announced().into_iter().map(KnownName::from).collect();
    let mut known = network::known_names();
    known.retain(|known| announced.iter().all(|other| other.name != known.name));
    let announced = announced.into_iter().map(|arm| network_line(&arm, "announced on the network"));
    announced.chain(known.iter().map(|arm| network_line(arm, "known, and not announced now"))).collect()
}

fn network_line(arm: &KnownName, state: &str) -> PortLine {
    PortLine {
        port: format!("sevenbot://{}", arm.name),
        description: arm.address.to_string(),
        arm: None,
        no_arm: Some(state.to_owned()),
    }
}

#[derive(Serialize)]
struct Ports {
    ports: Vec<PortLine>,
}

#[derive(Serialize)]
struct PortLine {
    port: String,
    description: String,
    arm: Option<FoundArm>,
    no_arm: Option<String>,
}

#[derive(Serialize)]
struct FoundArm {
    device_id: u8,
    firmware: String,
    chip_id: String,
}

impl From<ProbeResult> for PortLine {
    fn from(probed: ProbeResult) -> Self {
        let ProbeResult { port: PortInfo { name: port, description }, answer } = probed;
        match answer {
            Ok((identity, device_id)) => {
                let chip_id = identity.chip_name();
                let firmware = identity.version();
                let arm = Some(FoundArm { device_id, firmware, chip_id });
                Self { port, description, arm, no_arm: None }
            }
            Err(reason) => Self { port, description, arm: None, no_arm: Some(reason.to_string()) },
        }
    }
}

impl Printable for Ports {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        if self.ports.is_empty() {
            return writeln!(out, "this machine has no serial port");
        }
        let width = self.ports.iter().map(|line| line.port.chars().count()).max().unwrap_or_default();
        for line in &self.ports {
            line.write_text(width, out)?;
        }
        Ok(())
    }
}

impl PortLine {
    fn write_text(&self, width: usize, out: &mut dyn Write) -> io::Result<()> {
        let Self { port, description, arm, no_arm } = self;
        match arm {
            Some(FoundArm { device_id, firmware, chip_id }) => writeln!(
                out,
                "{port:<width$}  {GOOD}7Bot V2{GOOD:#}, id {device_id}, firmware {firmware}, chip {chip_id}"
            )?,
            None => writeln!(out, "{port:<width$}  {}", no_arm.as_deref().unwrap_or_default())?,
        }
        if description.is_empty() { Ok(()) } else { writeln!(out, "{:width$}  {description}", "") }
    }
}
