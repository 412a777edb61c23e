//! `serve`: one arm for many programs at once.

use std::io::{self, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use sevenbot::open_port::OpenPort;
use sevenbot::{OpenError, ports};
use sevenbot_serve::server::{AccessPolicy, ArmLocation, Notice, Server, ServerConfig};

use crate::command_error::CommandError;
use crate::printer::{Printable, note, warn};
use crate::session::Session;

/// Share the arm between many programs at once.
///
/// Each program sees an arm of its own: it gets the replies to its own requests, and the reports that it asked for
/// itself. Requests of all programs take turns on the arm's line. While the arm is unplugged, programs get no replies,
/// as on a cable; when it is plugged in again, they go on. Ctrl-C ends the server.
///
/// With --port the server keeps to this port. Without it, an arm that comes back under another name is found again, by
/// its chip id.
#[derive(Debug, Args)]
#[command(after_help = "\
Pseudo-terminals (--pty) work with every program that opens a serial port. TCP
(--tcp) carries the same frames, for example to pyserial's
`socket://127.0.0.1:7777`. The maker's WebSocket (--ws) works with the maker's
Python client; its web pages need --maker-pages as well.

Only programs of this computer can connect. --listen opens the TCP port and the
WebSocket to others. Then they need the token: over TCP as a first line, with a
line feed; over the WebSocket in its address, ws://ADDRESS:8080/ws?token=TOKEN.
The token passes the network unencrypted.

Two programs that write targets at the same time both move the arm: the last
target counts. --read-only is for programs that only watch.

Examples:
  sevenbot --port /dev/ttyUSB0 serve --pty ./a --pty ./b
  sevenbot --port ./a monitor  in a second terminal
  python my_program.py ./b     in a third
  sevenbot --port /dev/ttyUSB0 serve --tcp 7777
  sevenbot --port /dev/ttyUSB0 serve --ws --maker-pages
  sevenbot --port /dev/ttyUSB0 serve --tcp 7777 --listen 0.0.0.0 \\
      --token \"$(openssl rand -hex 16)\"")]
pub(crate) struct ServeArgs {
    /// Offer a pseudo-terminal behind this link. Repeat it for more programs.
    #[arg(long, value_name = "LINK")]
    pty: Vec<PathBuf>,
    /// Offer the frames on this TCP port; 0: a free one.
    #[arg(long, value_name = "PORT")]
    tcp: Option<u16>,
    /// Offer the maker's WebSocket on this port, at /ws.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "8080")]
    ws: Option<u16>,
    /// Accept web pages from anywhere, such as the maker's: each web site that is open in a browser on this computer can
    /// then move the arm. Without it only pages that this computer serves can connect.
    #[arg(long, requires = "ws")]
    maker_pages: bool,
    /// Listen on this address of this computer, for other computers; needs --token.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST), requires = "token")]
    listen: IpAddr,
    /// What programs have to know to connect over TCP.
    #[arg(long, env = "SEVENBOT_TOKEN", hide_env_values = true)]
    token: Option<String>,
    /// Write nothing to the arm. Programs can read, and choose their own reports.
    #[arg(long)]
    read_only: bool,
}

/// Where programs can connect.
#[derive(Serialize)]
pub(super) struct Ready {
    pub(super) ready: String,
}

impl Printable for Ready {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "ready {}", self.ready)
    }
}

pub(crate) fn run(session: &mut Session, args: &ServeArgs) -> Result<(), CommandError> {
    if args.pty.is_empty() && args.tcp.is_none() && args.ws.is_none() {
        return Err(CommandError::Usage(
            "nothing to serve: use --pty LINK for programs that open a serial port, --tcp PORT for others"
                .to_owned(),
        ));
    }
    if args.token.as_deref().is_some_and(|token| !is_token(token)) {
        return Err(CommandError::Usage(
            "--token: use 8 to 128 letters, digits and punctuation marks, without spaces".to_owned(),
        ));
    }
    let arm = location(session)?;
    check_not_busy(&arm, session.options.baud)?;
    let config = ServerConfig {
        arm: Some(arm),
        baud: session.options.baud,
        ptys: args.pty.clone(),
        tcp: args.tcp.map(|port| SocketAddr::new(args.listen, port)),
        web_socket: args.ws.map(|port| SocketAddr::new(args.listen, port)),
        page: None,
        access: AccessPolicy { token: args.token.clone(), allows_any_page: args.maker_pages },
        is_read_only: args.read_only,
    };
    // Before the links are created: Ctrl-C has to remove them.
    let stop = stop_signal()?;
    let server = Server::open(config).map_err(|error| CommandError::Arm(error.to_string()))?;
    for link in &args.pty {
        session.printer.print(&Ready { ready: link.display().to_string() })?;
    }
    if let Some(address) = server.tcp_address() {
        session.printer.print(&Ready { ready: format!("socket://{address}") })?;
    }
    if let Some(address) = server.web_socket_address() {
        session.printer.print(&Ready { ready: format!("ws://{address}/ws") })?;
    }
    run_server(server, &stop)
}

/// Serves until `stop` is readable.
pub(super) fn run_server(server: Server, stop: &UnixStream) -> Result<(), CommandError> {
    let ended = server.run(stop, &mut |notice| report(&notice));
    ended.map_err(|error| CommandError::Arm(format!("the operating system failed: {error}")))
}

/// A port from the command line is kept. Otherwise the arm is searched again each time it was unplugged.
pub(super) fn location(session: &Session) -> Result<ArmLocation, CommandError> {
    let first = PathBuf::from(session.port_name()?);
    let list = || ports::available().into_iter().map(|port| port.name.into()).collect();
    Ok(if session.port.is_some() { ArmLocation::Port(first) } else { ArmLocation::Search { first, list } })
}

/// Fails if another program has the arm's port open. A port that does not exist yet is waited for.
pub(super) fn check_not_busy(arm: &ArmLocation, baud: u32) -> Result<(), CommandError> {
    let (ArmLocation::Port(path) | ArmLocation::Search { first: path, .. }) = arm;
    let port = path.display().to_string();
    match OpenPort::open(&port, baud) {
        Err(error @ OpenError::Busy) => Err(CommandError::Open { port, error }),
        _ => Ok(()),
    }
}

/// Becomes readable at Ctrl-C, and at signals that ask a program to end.
pub(super) fn stop_signal() -> Result<UnixStream, CommandError> {
    let (stop, mut trigger) = UnixStream::pair()?;
    let handler = move || drop(trigger.write_all(&[0]));
    ctrlc::set_handler(handler)
        .map_err(|error| CommandError::Arm(format!("cannot catch Ctrl-C: {error}")))?;
    Ok(stop)
}

/// Long enough not to be guessed, and fit for a line and for an address.
fn is_token(token: &str) -> bool {
    (8..=128).contains(&token.len()) && token.bytes().all(|byte| byte.is_ascii_graphic())
}

fn report(notice: &Notice) {
    match notice {
        Notice::ArmFound(port) => note(format_args!("{}: the arm answers", port.display())),
        Notice::ArmLost { reason, .. } => warn(format_args!("no arm: {reason}. Trying again all the time")),
        Notice::ArmSilent(port) => warn(format_args!(
            "{}: the port is open, but no 7Bot V2 answers: has the arm power, and is --baud right? Trying again all \
             the time",
            port.display()
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_long_and_has_no_spaces() {
        assert!(is_token("0123456789abcdef"));
        for bad in ["", "short", "with a space in it", "line\nfeed in it", &"x".repeat(129)] {
            assert!(!is_token(bad), "{bad:?}");
        }
    }
}
