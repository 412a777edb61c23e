//! `sniff`: what goes over a line, in words.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;
use sevenbot::serial::Serial;
use sevenbot::traffic::{Listener, Traffic};

use crate::failure::Failure;
use crate::output::{Facts, Output};
use crate::session::Session;
use crate::style::DOUBTFUL;

/// Show what goes over a line, frame by frame, in words.
#[derive(Debug, Args)]
#[command(after_help = "\
The port is only listened to: an adapter whose receiving pin is connected to the line of interest. The
arm's own port brings only what the arm sends unasked.

Examples:
  sevenbot --port /dev/ttyUSB1 sniff
  sevenbot sniff capture.bin
  some-program | sevenbot sniff -")]
pub(crate) struct SniffArgs {
    /// A file with the bytes of a line; - is standard input. None: the port.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
}

/// Silence that no frame goes on after (D4).
const SILENCE: Duration = Duration::from_millis(100);

pub(crate) fn run(session: &mut Session, args: &SniffArgs) -> Result<(), Failure> {
    match &args.file {
        Some(path) if path.as_os_str() == "-" => file(&mut session.output, path, &mut io::stdin().lock()),
        Some(path) => {
            let mut opened = File::open(path).map_err(|error| Failure::file(path, error))?;
            file(&mut session.output, path, &mut opened)
        }
        None => port(session),
    }
}

fn file(output: &mut Output, path: &Path, source: &mut dyn Read) -> Result<(), Failure> {
    let mut listener = Listener::default();
    let mut chunk = [0; 4096];
    loop {
        match source.read(&mut chunk) {
            Ok(0) => break,
            Ok(length) => listener.hear(chunk.get(..length).unwrap_or(&chunk)),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(Failure::file(path, error)),
        }
        while let Some(heard) = listener.next() {
            output.show(&Line::new(None, &heard))?;
        }
    }
    while let Some(heard) = listener.next_before_silence() {
        output.show(&Line::new(None, &heard))?;
    }
    Ok(())
}

fn port(session: &mut Session) -> Result<(), Failure> {
    let name = session.port.clone().ok_or_else(|| {
        Failure::Usage("what to listen to? use --port PORT, or name a file; - is standard input".to_owned())
    })?;
    let opened = Serial::open(&name, session.options.baud);
    let mut port = opened.map_err(|error| Failure::Open { port: name, error })?;
    let mut listener = Listener::default();
    let start = Instant::now();
    loop {
        let bytes = port.receive(SILENCE).map_err(|error| Failure::Wire(error.into()))?;
        listener.hear(&bytes);
        let seconds = start.elapsed().as_secs_f64();
        while let Some(heard) =
            if bytes.is_empty() { listener.next_before_silence() } else { listener.next() }
        {
            session.output.show(&Line::new(Some(seconds), &heard))?;
        }
    }
}

#[derive(Serialize)]
struct Line {
    /// Since listening began; none in a file.
    seconds: Option<f64>,
    kind: &'static str,
    address: Option<u8>,
    count: Option<u8>,
    bytes: Vec<u8>,
    words: String,
}

impl Line {
    fn new(seconds: Option<f64>, heard: &Traffic) -> Self {
        let words = heard.to_string();
        let count_of = |values: &[u8]| u8::try_from(values.len()).ok();
        let (kind, address, count, bytes) = match heard {
            Traffic::Read { address, count } => ("read", Some(*address), Some(*count), &[][..]),
            Traffic::Answer { address, values } => {
                ("answer", Some(*address), count_of(values), values.as_slice())
            }
            Traffic::Write { address, values } => {
                ("write", Some(*address), count_of(values), values.as_slice())
            }
            Traffic::TooFar { address, count } => ("too-far", Some(*address), Some(*count), &[][..]),
            Traffic::Noise(bytes) => ("noise", None, None, bytes.as_slice()),
        };
        Self { seconds, kind, address, count, bytes: bytes.to_vec(), words }
    }
}

impl Facts for Line {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        if let Some(seconds) = self.seconds {
            write!(out, "{seconds:>9.3}  ")?;
        }
        let Self { words, .. } = self;
        match self.kind {
            "noise" | "too-far" => writeln!(out, "{DOUBTFUL}{words}{DOUBTFUL:#}"),
            _ => writeln!(out, "{words}"),
        }
    }
}
