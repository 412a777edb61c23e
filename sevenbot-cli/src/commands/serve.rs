//! `serve`: one arm for many programs at once.

use std::fs;
use std::io::{self, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use sevenbot::network::mdns::Announcement;
use sevenbot::network::{self, LocalServer, Registered, is_token};
use sevenbot::open_port::OpenPort;
use sevenbot::simulated::simulated_port;
use sevenbot::{OpenError, ports};
use sevenbot_serve::hub::{HoldOutcome, HubOptions};
use sevenbot_serve::server::{
    AccessPolicy, ArmLocation, Notice, RefusalReason, Server, ServerConfig, ServerStop, StartError, TlsFiles,
};

use crate::advice::START_SIMULATOR;
use crate::command_error::CommandError;
use crate::printer::{Printable, note, warn};
use crate::session::Session;

/// Share the arm between many programs at once.
///
/// Each program sees an arm of its own: it gets the replies to its own requests, and the reports that it asked for
/// itself. Requests of all programs take turns on the arm's line, and a stop goes before everything else. While the arm is
/// unplugged, programs get no replies, as on a cable; when it is plugged in again, they go on. Ctrl-C ends the server.
///
/// With --port the server keeps to this port. Without it, an arm that comes back under another name is found again, by
/// its chip id.
#[derive(Debug, Args)]
#[command(after_help = "\
Programs of this user reach the arm through a Unix socket that only they can
open; `sevenbot --port unix:PATH` uses it, and `sevenbot stop` finds it.
Pseudo-terminals (--pty) work with every program that opens a serial port. TCP
(--tcp) carries the same frames, for example to pyserial's
`socket://127.0.0.1:7777`. The maker's WebSocket (--ws) works with the maker's
Python client; its web pages need --maker-pages as well.

Only programs of this computer can connect. --listen opens the TCP port and the
WebSocket to others. Then they need the token: over TCP as a first line, with a
line feed; over the WebSocket in its address, ws://ADDRESS:8080/ws?token=TOKEN.
With --tls-cert and --tls-key both are encrypted (wss for the WebSocket), and
--port tls://HOST:7777 connects with the certificate in SEVENBOT_CERTIFICATE.

Two programs that write targets at the same time both move the arm: the last
target counts. With --one-driver the first one drives, until it has written no
target for a second. --read-only is for programs that only watch.

Examples:
  sevenbot --port /dev/ttyUSB0 serve --name lab-3
  sevenbot --port sevenbot://lab-3 monitor  in a second terminal
  sevenbot --port /dev/ttyUSB0 serve --pty ./a --pty ./b
  python my_program.py ./b     in a third
  sevenbot --port /dev/ttyUSB0 serve --tcp 7777
  sevenbot --port /dev/ttyUSB0 serve --ws --maker-pages
  sevenbot --port /dev/ttyUSB0 serve --tcp 7777 --listen 0.0.0.0 \\
      --token-file token.txt --tls-cert arm.pem --tls-key arm.key")]
pub(crate) struct ServeArgs {
    /// Offer a pseudo-terminal behind this link. Repeat it for more programs.
    #[arg(long, value_name = "LINK")]
    pty: Vec<PathBuf>,
    /// Offer the frames at this Unix socket. Without this option at one in the user's runtime directory.
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// A name for the arm: programs of this user find it as sevenbot://NAME. With --tcp and --listen also other computers, by
    /// multicast DNS.
    #[arg(long, value_parser = name)]
    name: Option<String>,
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
    /// Listen on this address of this computer, for other computers; needs --token-file or --token, and --tls-cert or
    /// --unencrypted.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST), requires = "token")]
    listen: IpAddr,
    /// What programs have to know to connect over TCP. Other users of this computer can see it in the list of processes: use
    /// --token-file.
    #[arg(
        long = "token",
        value_name = "TOKEN",
        env = "SEVENBOT_TOKEN",
        hide_env_values = true,
        id = "token_text",
        group = "token"
    )]
    token: Option<String>,
    /// Read the token from the first line of a file, which may be a descriptor: /dev/fd/3.
    #[arg(long, value_name = "FILE", group = "token")]
    token_file: Option<PathBuf>,
    /// Encrypt TCP and the WebSocket with this certificate, a file in PEM.
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The private key of the certificate, a file in PEM.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Let the token and all frames pass the network unencrypted: everybody there can read them, and then move the arm.
    #[arg(long, conflicts_with = "tls_cert")]
    unencrypted: bool,
    /// Only one program moves the arm at a time; the others watch, and can stop it.
    #[arg(long)]
    one_driver: bool,
    /// Write nothing to the arm. Programs can read, and choose their own reports.
    #[arg(long)]
    read_only: bool,
}

/// Linux and macOS accept a path of a Unix socket with up to this many bytes.
const LONGEST_PATH: usize = 100;

/// An address or a link at which programs can connect.
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
    let config = config(session, args)?;
    let local = local(args);
    if local.is_none() && args.pty.is_empty() && args.tcp.is_none() && args.ws.is_none() {
        return Err(CommandError::Usage(
            "nothing to serve: use --pty LINK for programs that open a serial port, --tcp PORT for others"
                .to_owned(),
        ));
    }
    let (server, stop) = open_server(config, local.as_ref(), Server::open)?;
    announce(session, args, &server)?;
    let _announcement = announce_name(args, &server);
    run_server(server, &stop, local.as_ref())
}

/// Catches Ctrl-C, then opens the server by `open`, with the Unix socket of `local`.
pub(super) fn open_server(
    config: ServerConfig,
    local: Option<&LocalServer>,
    open: impl FnOnce(ServerConfig) -> Result<Server, StartError>,
) -> Result<(Server, ServerStop), CommandError> {
    // Catch Ctrl-C before the links are created, so that it does not leave them behind.
    let stop = stop_signal()?;
    let config = ServerConfig { socket: local.map(|local| local.socket.clone()), ..config };
    let server = open(config).map_err(|error| CommandError::Arm(error.to_string()))?;
    Ok((server, stop))
}

/// Serves until it is stopped. Other programs of this user find the server by `local`.
pub(super) fn run_server(
    server: Server,
    stop: &ServerStop,
    local: Option<&LocalServer>,
) -> Result<(), CommandError> {
    let mut registered = None;
    let ended = server.run(stop, &mut |notice| {
        if let (Notice::ArmFound(port), Some(local)) = (&notice, local) {
            registered = register(local, port);
        }
        report(&notice);
    });
    ended.map_err(|error| CommandError::Arm(format!("the operating system failed: {error}")))
}

/// The Unix socket and the name of the server, for other programs of this user. `None` as from [`default_local`].
fn local(args: &ServeArgs) -> Option<LocalServer> {
    let name = args.name.clone();
    match &args.socket {
        Some(socket) => Some(LocalServer { socket: socket.clone(), name, ..LocalServer::default() }),
        None => default_local(name),
    }
}

/// The Unix socket in the user's runtime directory; `None` if there is no such directory or the path is too long.
pub(super) fn default_local(name: Option<String>) -> Option<LocalServer> {
    LocalServer::of_this_process(name).filter(|local| local.socket.as_os_str().len() <= LONGEST_PATH)
}

/// Announces the name to the local network, if other computers can connect over TCP.
fn announce_name(args: &ServeArgs, server: &Server) -> Option<Announcement> {
    let (name, address) =
        args.name.as_ref().zip(server.tcp_address().filter(|address| !address.ip().is_loopback()))?;
    let announced = Announcement::new(name, address, args.tls_cert.is_some());
    announced.inspect_err(|error| warn(format_args!("the name is not announced: {error}"))).ok()
}

/// Tells other programs of this user which port the server holds.
fn register(local: &LocalServer, port: &Path) -> Option<Registered> {
    let server = LocalServer { port: port.to_owned(), ..local.clone() };
    let failed = |error: &io::Error| warn(format_args!("`sevenbot stop` will not find this server: {error}"));
    server.register().inspect_err(failed).ok()
}

/// Prints where programs can connect.
fn announce(session: &mut Session, args: &ServeArgs, server: &Server) -> Result<(), CommandError> {
    let links = args.pty.iter().map(|link| link.display().to_string());
    let (bytes, messages) = if args.tls_cert.is_some() { ("tls", "wss") } else { ("socket", "ws") };
    let tcp = server.tcp_address().map(|address| format!("{bytes}://{address}"));
    let web = server.web_socket_address().map(|address| format!("{messages}://{address}/ws"));
    for ready in links.chain(tcp).chain(web) {
        session.printer.print(&Ready { ready })?;
    }
    if let Some(path) = server.socket_path() {
        session.printer.print(&Ready { ready: format!("unix:{}", path.display()) })?;
    }
    Ok(())
}

fn config(session: &Session, args: &ServeArgs) -> Result<ServerConfig, CommandError> {
    let is_network = args.tcp.is_some() || args.ws.is_some();
    if !args.listen.is_loopback() && is_network && args.tls_cert.is_none() && !args.unencrypted {
        return Err(CommandError::Usage(
            "--listen: the token would pass the network unencrypted. Use --tls-cert and --tls-key, or --unencrypted if \
             everybody on this network may move the arm"
                .to_owned(),
        ));
    }
    let token = token(args)?;
    let arm = location(session)?;
    check_not_busy(&arm, session.options.baud)?;
    let tls = args.tls_cert.clone().zip(args.tls_key.clone());
    Ok(ServerConfig {
        ptys: args.pty.clone(),
        tcp: args.tcp.map(|port| SocketAddr::new(args.listen, port)),
        web_socket: args.ws.map(|port| SocketAddr::new(args.listen, port)),
        access: AccessPolicy { token, allows_any_page: args.maker_pages },
        tls: tls.map(|(certificate, key)| TlsFiles { certificate, key }),
        options: HubOptions { is_read_only: args.read_only, has_one_driver: args.one_driver },
        ..ServerConfig::new(Some(arm), session.options.baud)
    })
}

/// The token from the command line or the token file; `None` if neither is given.
fn token(args: &ServeArgs) -> Result<Option<String>, CommandError> {
    let token = match &args.token_file {
        None => args.token.clone(),
        Some(path) => {
            let text = fs::read_to_string(path).map_err(|error| CommandError::file(path, error))?;
            Some(text.lines().next().unwrap_or_default().to_owned())
        }
    };
    if token.as_deref().is_some_and(|token| !is_token(token)) {
        return Err(CommandError::Usage(
            "the token: use 8 to 128 letters, digits and punctuation marks, without spaces".to_owned(),
        ));
    }
    Ok(token)
}

/// Parses the name of an arm.
fn name(text: &str) -> Result<String, &'static str> {
    if network::is_name(text) { Ok(text.to_owned()) } else { Err(network::NAME_RULE) }
}

/// The location of the arm: the port from the command line only, or a search for the arm each time it was unplugged.
pub(super) fn location(session: &Session) -> Result<ArmLocation, CommandError> {
    let first = session.own_port_name()?;
    if simulated_port(&first).is_some() {
        let reason = format!("the arm of --port sim lives in one command only: {START_SIMULATOR}");
        return Err(CommandError::Usage(reason));
    }
    let first = PathBuf::from(first);
    let list = || ports::available().into_iter().map(|port| port.name.into()).collect();
    Ok(if session.port.is_some() { ArmLocation::Port(first) } else { ArmLocation::Search { first, list } })
}

/// Fails if another program has the arm's port open. A port that does not exist yet is no error: the server waits for it.
pub(super) fn check_not_busy(arm: &ArmLocation, baud: u32) -> Result<(), CommandError> {
    let (ArmLocation::Port(path) | ArmLocation::Search { first: path, .. }) = arm;
    let port = path.display().to_string();
    match OpenPort::open(&port, baud) {
        Err(error @ OpenError::Busy) => Err(CommandError::Open { port, error }),
        _ => Ok(()),
    }
}

/// Ends the server at Ctrl-C, and at signals that ask a program to end.
fn stop_signal() -> Result<ServerStop, CommandError> {
    let stop = ServerStop::default();
    let trigger = stop.clone();
    ctrlc::set_handler(move || trigger.stop())
        .map_err(|error| CommandError::Arm(format!("cannot catch Ctrl-C: {error}")))?;
    Ok(stop)
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
        Notice::HoldFailed(HoldOutcome::NotRestored) => warn(format_args!(
            "the server held the arm, which did not take back its speeds or its set-point period. Programs that need them \
             have to write them again"
        )),
        Notice::HoldFailed(_) => {
            warn(format_args!("the server held the arm, which did not confirm it: it may be moving"));
        }
        Notice::Refused { peer, reason } => warn(format_args!(
            "a client was refused{}: {}",
            peer.map(|peer| format!(", {peer}")).unwrap_or_default(),
            match reason {
                RefusalReason::WrongToken => "its token is wrong",
                RefusalReason::Full => "there are too many clients",
                RefusalReason::NoFrames =>
                    "it does not speak frames, as a web page does that tries this port",
            }
        )),
    }
}
