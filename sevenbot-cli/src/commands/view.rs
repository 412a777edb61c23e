//! `view`: the arm in a browser.

use std::net::{Ipv4Addr, SocketAddr};

use clap::Args;
use sevenbot::simulated::simulated_port;
use sevenbot_serve::hub::HubOptions;
use sevenbot_serve::server::{ArmLocation, PageConfig, Server, ServerConfig, StartError};

use super::serve::{Ready, check_not_busy, default_local, location, open_server, run_server};
use crate::command_error::CommandError;
use crate::page_file;
use crate::printer::note;
use crate::secret::new_secret;
use crate::session::Session;

/// The default port. It should be the same each time, because a browser keeps permissions and settings per port.
const USUAL_PORT: u16 = 7780;

/// Show and move the arm in a browser.
///
/// Opens a page with the arm in 3D, its state, its registers and its recordings. Without an arm the page simulates one. The
/// page and the arm are for programs of this computer only. Nothing is loaded from the internet. Ctrl-C ends the server.
#[derive(Debug, Args)]
#[command(after_help = "\
The address contains a token, which is different each time. A page without it
can show and move a simulated arm only. So do not pass the address on. Keep the
page's window in view while the arm moves: the space bar stops the arm.

`sevenbot stop` stops the arm while the page has it, and other programs of this
user find it with `sevenbot ports`. `view --port` accepts a link of `serve`.

Examples:
  sevenbot view             the only port that leads to an arm; without one, a
                            simulated arm
  sevenbot --port /dev/ttyUSB0 view
  sevenbot --port /dev/ttyUSB0 view --read-only
                            the page shows the arm and cannot move it
  sevenbot view --simulate  look for no arm
  sevenbot view --no-open --http 8000
                            prints the address, and opens no browser")]
pub(crate) struct ViewArgs {
    /// Serve the page on this port; 0: a free one. Without this option 7780, or a free one.
    #[arg(long, value_name = "PORT")]
    http: Option<u16>,
    /// Print the address, and open no browser.
    #[arg(long)]
    no_open: bool,
    /// Write nothing to the arm.
    #[arg(long)]
    read_only: bool,
    /// Look for no arm: the page simulates one.
    #[arg(long, conflicts_with = "read_only")]
    simulate: bool,
}

pub(crate) fn run(session: &mut Session, args: &ViewArgs) -> Result<(), CommandError> {
    page_file::check()?;
    let arm = if args.simulate { None } else { find_arm(session)? };
    arm.iter().try_for_each(|arm| check_not_busy(arm, session.options.baud))?;
    let token = new_secret()?;
    let page = PageConfig {
        address: SocketAddr::from((Ipv4Addr::LOCALHOST, args.http.unwrap_or(USUAL_PORT))),
        token: token.clone(),
        files: page_file::find,
    };
    let query = if arm.is_some() { format!("?token={token}") } else { String::new() };
    let local = arm.as_ref().and_then(|_| default_local(None));
    let config = ServerConfig {
        page: Some(page),
        options: HubOptions { is_read_only: args.read_only, ..HubOptions::default() },
        ..ServerConfig::new(arm, session.options.baud)
    };
    let (server, stop) = open_server(config, local.as_ref(), |config| open(config, args.http.is_none()))?;
    if let Some(address) = server.page_address() {
        let address = format!("http://{address}/{query}");
        session.printer.print(&Ready { ready: address.clone() })?;
        if !args.no_open && open::that_detached(&address).is_err() {
            note(format_args!("no browser starts: open the address above"));
        }
    }
    run_server(server, &stop, local.as_ref())
}

/// The location of the arm. `None`: no port leads to one, or the port is a simulated arm, which the page simulates itself.
fn find_arm(session: &Session) -> Result<Option<ArmLocation>, CommandError> {
    if session.port.as_deref().and_then(simulated_port).is_some() {
        return Ok(None);
    }
    match location(session) {
        Ok(arm) => Ok(Some(arm)),
        Err(CommandError::NoArm { .. }) => {
            note(format_args!(
                "no arm found: the page simulates one. To use an arm, connect it and start again"
            ));
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// Opens the server. With `any_port` a port in use is replaced by a free one.
fn open(mut config: ServerConfig, any_port: bool) -> Result<Server, StartError> {
    match Server::open(config.clone()) {
        Err(StartError::InUse(_)) if any_port => {
            if let Some(page) = &mut config.page {
                page.address.set_port(0);
            }
            Server::open(config)
        }
        outcome => outcome,
    }
}
