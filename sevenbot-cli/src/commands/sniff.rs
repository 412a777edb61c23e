//! `sniff`: shows the traffic of a line as text.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;
use sevenbot::host_line::HostLine;
use sevenbot::open_port::OpenPort;
use sevenbot::traffic::{Traffic, TrafficParser};
use sevenbot::wire_log::{self, Sender};

use crate::command_error::CommandError;
use crate::printer::{Printable, Printer};
use crate::session::{Session, check_is_no_server};
use crate::style::WARNING;

/// Show the traffic of a line as text, frame by frame.
#[derive(Debug, Args)]
#[command(after_help = "\
The port is only read. Connect the receiving pin of an adapter to the line. On
the arm's own port only reports appear.

Examples:
  sevenbot --port /dev/ttyUSB1 sniff
  sevenbot sniff capture.bin
  sevenbot --log run.log home --wait; sevenbot sniff run.log
  some-program | sevenbot sniff -")]
pub(crate) struct SniffArgs {
    /// File with the bytes of a line, a log of --log, or a session of `host-sim --record`; - is standard input. Without it, the port.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
}

/// Bytes at the start of a file that are enough to recognize a log.
const LONGEST_HEAD: u64 = 64;
/// An idle line ends an unfinished frame after this time (D4).
const GAP: Duration = Duration::from_millis(100);

pub(crate) fn run(session: &mut Session, args: &SniffArgs) -> Result<(), CommandError> {
    match &args.file {
        Some(path) if path.as_os_str() == "-" => file(&mut session.printer, path, &mut io::stdin().lock()),
        Some(path) if is_log_file(path)? => log(&mut session.printer, path),
        Some(path) => {
            let mut opened = File::open(path).map_err(|error| CommandError::file(path, error))?;
            file(&mut session.printer, path, &mut opened)
        }
        None => port(session),
    }
}

fn is_log_file(path: &Path) -> Result<bool, CommandError> {
    let mut start = Vec::new();
    let opened = File::open(path).map_err(|error| CommandError::file(path, error))?;
    opened.take(LONGEST_HEAD).read_to_end(&mut start).map_err(|error| CommandError::file(path, error))?;
    Ok(wire_log::is_log(&start))
}

/// Prints a log of `--log` or a session of `host-sim --record`, with times. Parses each direction separately.
fn log(printer: &mut Printer, path: &Path) -> Result<(), CommandError> {
    let text = fs::read_to_string(path).map_err(|error| CommandError::file(path, error))?;
    let entries = wire_log::entries(&text).map_err(|line| {
        CommandError::file(path, format!("line {line} is no entry of a log: delete it to see the others"))
    })?;
    let (mut host, mut arm) = (TrafficParser::default(), TrafficParser::default());
    for entry in &entries {
        let parser = if entry.sender == Sender::Host { &mut host } else { &mut arm };
        parser.push(&entry.bytes);
        while let Some(item) = parser.next() {
            printer.print(&TrafficLine::new(Some(entry.time.as_secs_f64()), &item))?;
        }
    }
    let end = entries.last().map_or(0.0, |entry| entry.time.as_secs_f64());
    for mut parser in [host, arm] {
        while let Some(item) = parser.next_at_gap() {
            printer.print(&TrafficLine::new(Some(end), &item))?;
        }
    }
    Ok(())
}

fn file(printer: &mut Printer, path: &Path, source: &mut dyn Read) -> Result<(), CommandError> {
    let mut parser = TrafficParser::default();
    let mut chunk = [0; 4096];
    loop {
        match source.read(&mut chunk) {
            Ok(0) => break,
            Ok(length) => parser.push(chunk.get(..length).unwrap_or(&chunk)),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(CommandError::file(path, error)),
        }
        while let Some(item) = parser.next() {
            printer.print(&TrafficLine::new(None, &item))?;
        }
    }
    while let Some(item) = parser.next_at_gap() {
        printer.print(&TrafficLine::new(None, &item))?;
    }
    Ok(())
}

fn port(session: &mut Session) -> Result<(), CommandError> {
    let name = session.port.clone().ok_or_else(|| {
        CommandError::Usage("no input: use --port PORT, or give a file; - is standard input".to_owned())
    })?;
    check_is_no_server(&name)?;
    let opened = OpenPort::open(&name, session.options.baud);
    let mut port = opened.map_err(|error| CommandError::Open { port: name, error })?;
    let mut parser = TrafficParser::default();
    let start = Instant::now();
    loop {
        let bytes = port.receive(GAP).map_err(|error| CommandError::Exchange(error.into()))?;
        parser.push(&bytes);
        let seconds = start.elapsed().as_secs_f64();
        while let Some(item) = if bytes.is_empty() { parser.next_at_gap() } else { parser.next() } {
            session.printer.print(&TrafficLine::new(Some(seconds), &item))?;
        }
    }
}

#[derive(Serialize)]
struct TrafficLine {
    /// Since the start of the capture or of the log; `None` for raw bytes, which have no times.
    seconds: Option<f64>,
    kind: &'static str,
    address: Option<u8>,
    count: Option<u8>,
    bytes: Vec<u8>,
    words: String,
}

impl TrafficLine {
    fn new(seconds: Option<f64>, item: &Traffic) -> Self {
        let words = item.to_string();
        let count_of = |values: &[u8]| u8::try_from(values.len()).ok();
        let (kind, address, count, bytes) = match item {
            Traffic::Read { address, count } => ("read", Some(*address), Some(*count), &[][..]),
            Traffic::Answer { address, values } => {
                ("answer", Some(*address), count_of(values), values.as_slice())
            }
            Traffic::Write { address, values } => {
                ("write", Some(*address), count_of(values), values.as_slice())
            }
            Traffic::WriteMap21 { address, values } => {
                ("write-map-2.1", Some(*address), count_of(values), values.as_slice())
            }
            Traffic::Report { address, values } => {
                ("report", Some(*address), count_of(values), values.as_slice())
            }
            Traffic::Alarm { .. } => ("alarm", None, None, &[][..]),
            Traffic::TooFar { address, count } => ("too-far", Some(*address), Some(*count), &[][..]),
            Traffic::Noise(bytes) => ("noise", None, None, bytes.as_slice()),
        };
        Self { seconds, kind, address, count, bytes: bytes.to_vec(), words }
    }
}

impl Printable for TrafficLine {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        if let Some(seconds) = self.seconds {
            write!(out, "{seconds:>9.3}  ")?;
        }
        let Self { words, .. } = self;
        match self.kind {
            "noise" | "too-far" => writeln!(out, "{WARNING}{words}{WARNING:#}"),
            _ => writeln!(out, "{words}"),
        }
    }
}
