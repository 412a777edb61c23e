//! `class`: a teacher's screen, and a page with a simulated arm for each pupil.

use std::io::{self, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use sevenbot_serve::hub::HubOptions;
use sevenbot_serve::server::{ArmLocation, ClassConfig, Server, ServerConfig, TlsFiles};

use super::serve::{check_not_busy, default_local, location, open_server, run_server};
use crate::command_error::CommandError;
use crate::page_file;
use crate::printer::{Printable, note};
use crate::secret::{key, new_class_code, new_secret};
use crate::session::Session;

/// The default TCP port. It is short, because the teacher writes the address on a board.
const USUAL_PORT: u16 = 7700;
/// The allowed length of a `--code`, in characters.
const CODE_LENGTH: std::ops::RangeInclusive<usize> = 6..=32;

/// Teach a class: an arm in each pupil's browser, and a screen for the teacher.
///
/// Prints two addresses. Pupils open the first one, type their names, and each has a simulated arm in the browser. The second one
/// is for the teacher: a tile with each pupil's arm, STOP for all, and a message to all. With --port there is a real arm as
/// well, which the teacher gives to one pupil at a time, for some minutes. Nothing needs the internet, and there are no
/// accounts. Ctrl-C ends the class.
#[derive(Debug, Args)]
#[command(after_help = "\
Without --listen only browsers of this computer can join. With it, the laptops
in the room open the printed address, and type the class code, which is another
one each time. Write both on the board. Do not pass on the second address: with
it anyone can stop all arms and give the real one away.

The pages pass the network unencrypted with --unencrypted: who can listen there
learns the class code, and can join. The teacher's address stays in this
computer. With --tls-cert and --tls-key the browsers have to accept the
certificate once.

`sevenbot stop` stops the real arm as well, and programs of this user find it
with `sevenbot ports`.

Examples:
  sevenbot class            on this computer only, to try it
  sevenbot class --listen 0.0.0.0 --unencrypted
                            for the laptops in the room
  sevenbot --port /dev/ttyUSB0 class --listen 0.0.0.0 --unencrypted
                            with a real arm, given to one pupil at a time
  sevenbot class --listen 0.0.0.0 --unencrypted --code robots7 --http 80
                            a code that is easy to say, and an address without
                            a port; on Linux port 80 is for root")]
pub(crate) struct ClassArgs {
    /// Serve the pages on this port; 0: a free one.
    #[arg(long, value_name = "PORT", default_value_t = USUAL_PORT)]
    http: u16,
    /// Listen on this address of this computer, for the laptops in the room; 0.0.0.0: on all of them. Needs --unencrypted or
    /// --tls-cert.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// What pupils type to join: 6 to 32 small letters and digits. Without this option a new one each time, or none if only this
    /// computer can join.
    #[arg(long, value_name = "CODE", value_parser = code)]
    code: Option<String>,
    /// Encrypt with this certificate, a file in PEM.
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The private key of the certificate, a file in PEM.
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Let the pages and the class code pass the network unencrypted.
    #[arg(long, conflicts_with = "tls_cert")]
    unencrypted: bool,
    /// Open no browser with the teacher's screen.
    #[arg(long)]
    no_open: bool,
}

/// An address that a browser can open.
#[derive(Serialize)]
struct ReadyPage {
    ready: String,
    /// `pupils` or `teacher`.
    r#for: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    code: Option<String>,
}

impl Printable for ReadyPage {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "ready {}", self.ready)
    }
}

pub(crate) fn run(session: &mut Session, args: &ClassArgs) -> Result<(), CommandError> {
    page_file::check()?;
    check_encryption(args)?;
    let arm = session.port.is_some().then(|| location(session)).transpose()?;
    arm.iter().try_for_each(|arm| check_not_busy(arm, session.options.baud))?;
    let (config, pages) = config(session, args, arm)?;
    let local = config.arm.as_ref().and_then(|_| default_local(None));
    let (server, stop) = open_server(config, local.as_ref(), Server::open)?;
    pages.announce(session, args, &server)?;
    run_server(server, &stop, local.as_ref())
}

fn check_encryption(args: &ClassArgs) -> Result<(), CommandError> {
    if args.listen.is_loopback() || args.tls_cert.is_some() || args.unencrypted {
        return Ok(());
    }
    let reason = "--listen: the class code would pass the network unencrypted. Use --unencrypted if this is the network of the \
                  class room only, or --tls-cert and --tls-key";
    Err(CommandError::Usage(reason.to_owned()))
}

/// What the pupils and the teacher need to open their pages.
struct Pages {
    hosts: Vec<IpAddr>,
    code: Option<String>,
    secret: String,
}

fn config(
    session: &Session,
    args: &ClassArgs,
    arm: Option<ArmLocation>,
) -> Result<(ServerConfig, Pages), CommandError> {
    let code = match &args.code {
        None if !args.listen.is_loopback() => Some(new_class_code()?),
        code => code.clone(),
    };
    let pages = Pages { hosts: hosts(args.listen), code, secret: new_secret()? };
    let class = ClassConfig {
        address: SocketAddr::new(args.listen, args.http),
        files: page_file::find,
        code: pages.code.clone(),
        secret: pages.secret.clone(),
        hosts: pages.hosts.clone(),
        new_key: key,
    };
    let tls = args.tls_cert.clone().zip(args.tls_key.clone());
    let config = ServerConfig {
        class: Some(class),
        tls: tls.map(|(certificate, key)| TlsFiles { certificate, key }),
        options: HubOptions { has_one_driver: true, ..HubOptions::default() },
        ..ServerConfig::new(arm, session.options.baud)
    };
    Ok((config, pages))
}

/// The addresses at which pupils reach the server: `listen`, or if that is unspecified (0.0.0.0 or ::), the IPv4 addresses of
/// this computer without loopback and link-local ones.
fn hosts(listen: IpAddr) -> Vec<IpAddr> {
    if !listen.is_unspecified() {
        return vec![listen];
    }
    let is_usual = |ip: &IpAddr| ip.is_ipv4() && !ip.is_loopback();
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    interfaces
        .iter()
        .filter(|interface| !interface.is_link_local())
        .map(|it| it.ip())
        .filter(is_usual)
        .collect()
}

impl Pages {
    /// Prints the addresses, and opens the teacher's screen in a browser unless `--no-open` is given.
    fn announce(self, session: &mut Session, args: &ClassArgs, server: &Server) -> Result<(), CommandError> {
        let page = |host: IpAddr| server.class_page(host).unwrap_or_default();
        let own = if args.listen.is_unspecified() { IpAddr::V4(Ipv4Addr::LOCALHOST) } else { args.listen };
        let first = self.hosts.first().copied().unwrap_or(own);
        let teacher = format!("{}teacher.html?token={}", page(own), self.secret);
        let for_pupils = ReadyPage { ready: page(first), r#for: "pupils", code: self.code.clone() };
        session.printer.print(&for_pupils)?;
        session.printer.print(&ReadyPage { ready: teacher.clone(), r#for: "teacher", code: None })?;
        let code = self.code.map_or(String::new(), |code| format!(" and the class code {code}"));
        note(format_args!(
            "pupils open the first address, and type a name{code}. The second one is yours alone"
        ));
        let others: Vec<_> = self.hosts.iter().skip(1).map(|&host| page(host)).collect();
        if !others.is_empty() {
            note(format_args!("in another network of this computer, pupils open {}", others.join(" or ")));
        }
        if !args.no_open && open::that_detached(&teacher).is_err() {
            note(format_args!("no browser starts: open the second address"));
        }
        Ok(())
    }
}

/// Parses a class code.
fn code(text: &str) -> Result<String, &'static str> {
    let is_code = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
    let is_valid = CODE_LENGTH.contains(&text.len()) && text.bytes().all(is_code);
    if is_valid { Ok(text.to_owned()) } else { Err("use 6 to 32 small letters and digits") }
}
