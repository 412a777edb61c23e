//! `ports`: lists the serial ports of this machine, and the arms behind them.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;
use sevenbot::network::mdns::{self, Announced};
use sevenbot::ports::{PortInfo, ProbeResult, probe, reachable};

use crate::command_error::CommandError;
use crate::printer::Printable;
use crate::session::Session;
use crate::style::GOOD;

/// List serial ports and servers, and the arms behind them.
#[derive(Debug, Args)]
#[command(after_help = "\
Opens all ports at the same time and asks each for its device code. Other
devices receive 14 bytes. Lists the servers of this user, too; an arm that
`sevenbot serve` holds is found through its server.

Examples:
  sevenbot ports
  sevenbot ports /dev/ttyUSB0 ./7bot     only these, also unlisted ones")]
pub(crate) struct PortsArgs {
    /// Ask only these ports.
    #[arg(value_name = "PORT")]
    ports: Vec<String>,
    /// Ask the local network for the names of arms, too. It takes a second and a half.
    #[arg(long)]
    network: bool,
}

pub(crate) fn run(session: &mut Session, args: &PortsArgs) -> Result<(), CommandError> {
    let named = args.ports.iter().chain(&session.port);
    let named = named.map(|name| PortInfo { name: name.clone(), description: String::new() });
    let mut asked = if args.ports.is_empty() { reachable() } else { Vec::new() };
    for port in named {
        if asked.iter().all(|known| known.name != port.name) {
            asked.push(port);
        }
    }
    let announced = if args.network { mdns::announced() } else { Vec::new() };
    let ports = probe(asked, session.options.baud).into_iter().map(PortLine::from);
    let ports = ports.chain(announced.into_iter().map(announced_line)).collect();
    session.printer.print(&Ports { ports })
}

/// A server of the local network in the list of ports. It is not asked: it may want a token.
fn announced_line(arm: Announced) -> PortLine {
    let Announced { name, address, is_encrypted } = arm;
    let scheme = if is_encrypted { "tls" } else { "tcp" };
    let port = format!("sevenbot://{name}");
    PortLine {
        port,
        description: format!("{scheme}://{address}"),
        arm: None,
        no_arm: Some("announced on the network".to_owned()),
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
