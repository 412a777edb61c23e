//! Recorded sessions in files: `--record` and `--replay`. [`arm_sim::session`] describes the format.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use arm_sim::flash::Memory;
use arm_sim::replay::{Difference, Replay, ReplayError};
use arm_sim::session::{ControllerKind, Entry, SessionEvent, SessionHeader, SessionRecorder};
use arm_sim::tap::Tap;
use tracing::error;

use crate::cli::Options;
use crate::per_arm;
use crate::trace::Trace;

/// Why a session cannot be recorded or replayed, or where the replay differs.
#[derive(Debug, thiserror::Error)]
pub enum SessionFileError {
    /// The file cannot be created, read or written.
    #[error("cannot {verb} {}: {cause}", path.display())]
    File {
        /// The operation that failed: `read` or `write`.
        verb: &'static str,
        /// The file that was to be read or written.
        path: PathBuf,
        /// The system's reason.
        cause: io::Error,
    },
    /// The file to record to exists.
    #[error("--record {}: the file exists: choose another name, or replace it with --force", .0.display())]
    Exists(PathBuf),
    /// The file is not a session.
    #[error("{}: {reason}", path.display())]
    NoSession {
        /// The file that was to be replayed.
        path: PathBuf,
        /// Why it is no session.
        reason: ReplayError,
    },
    /// The arm sent other bytes than in the file.
    #[error("{}, line {line}: {difference}{}", path.display(), in_words(frame))]
    Different {
        /// The file that was replayed.
        path: PathBuf,
        /// The number of the line; the first is 1.
        line: usize,
        /// The bytes of the file and of the replaying arm, and when the host took them.
        difference: Difference,
        /// The frame of the session that differs, in words.
        frame: Option<String>,
    },
}

fn in_words(frame: &Option<String>) -> String {
    frame.as_ref().map_or(String::new(), |frame| format!(". In the session this was '{frame}'"))
}

/// The frames that the arm of a session sent, in words as in `--trace`.
struct SentFrames {
    trace: Trace,
    last: Arc<Mutex<Option<String>>>,
}

impl SentFrames {
    fn new() -> Self {
        let last = Arc::new(Mutex::new(None));
        let sink = Arc::clone(&last);
        let trace = Trace::new(Box::new(move |line| {
            *sink.lock().unwrap_or_else(PoisonError::into_inner) = Some(line.to_owned());
        }));
        Self { trace, last }
    }

    /// Takes a line of the session. Returns the last frame that ends in this line.
    fn line(&mut self, line: &str) -> Option<String> {
        if let Ok(Entry { now, event: SessionEvent::Taken(bytes) }) = line.parse() {
            self.trace.sent(now, &bytes);
        }
        self.last.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// The first lines of a recorded session.
#[must_use]
pub fn header(options: &Options, number: Option<u16>, seed: u64, settings: &Memory) -> SessionHeader {
    let controller =
        if options.as_maker.is_some() { ControllerKind::Maker } else { ControllerKind::Sevenbot };
    SessionHeader {
        controller,
        seed,
        chip_id: per_arm::chip_id(options.chip_id, number),
        is_paced: !options.unpaced,
        is_bytewise: options.lockstep.is_some(),
        torque_codes: options.torque_codes,
        settings: settings.bytes().to_vec(),
        ..SessionHeader::default()
    }
}

/// Writes a session to a file. Each line reaches the file before the arm goes on.
#[derive(Debug)]
pub struct SessionFile {
    path: PathBuf,
    /// `None` after a failure.
    file: Option<File>,
}

impl SessionFile {
    /// Creates the file and writes its first lines. Replaces an existing file only with `may_replace`.
    ///
    /// # Errors
    /// The file exists, or cannot be created or written.
    pub fn create(path: &Path, header: &SessionHeader, may_replace: bool) -> Result<Self, SessionFileError> {
        let failed = |cause| SessionFileError::File { verb: "write", path: path.to_owned(), cause };
        // Opening a pipe or a device destroys no data.
        if !may_replace && path.is_file() {
            return Err(SessionFileError::Exists(path.to_owned()));
        }
        let mut file = File::create(path).map_err(failed)?;
        writeln!(file, "{header}").map_err(failed)?;
        Ok(Self { path: path.to_owned(), file: Some(file) })
    }
}

impl SessionRecorder for SessionFile {
    fn add(&mut self, entry: &Entry) {
        let Some(file) = &mut self.file else { return };
        // One system call writes the whole line.
        if let Err(cause) = file.write_all(format!("{entry}\n").as_bytes()) {
            error!("cannot write {}: {cause}: the recording ends here", self.path.display());
            self.file = None;
        }
    }
}

/// Replays a file. Returns the number of its lines.
///
/// # Errors
/// The file cannot be read, is not a session, or the arm sent other bytes.
pub fn replay(path: &Path) -> Result<usize, SessionFileError> {
    let failed = |cause| SessionFileError::File { verb: "read", path: path.to_owned(), cause };
    let told = |reason, frame| match reason {
        ReplayError::Different { line, difference } => {
            SessionFileError::Different { path: path.to_owned(), line, difference, frame }
        }
        reason => SessionFileError::NoSession { path: path.to_owned(), reason },
    };
    let mut lines = BufReader::new(File::open(path).map_err(failed)?).lines();
    let mut next = || lines.next().transpose().map_err(failed);
    let (first, second) = (next()?.unwrap_or_default(), next()?.unwrap_or_default());
    let header = SessionHeader::parse(&first, &second).map_err(|reason| told(reason.into(), None))?;
    let (mut replay, mut sent) = (Replay::new(&header), SentFrames::new());
    let mut count = 2;
    while let Some(line) = next()? {
        let frame = sent.line(&line);
        if let Err(reason) = replay.line(&line) {
            let mut later = std::iter::from_fn(|| next().ok().flatten());
            let frame = frame.or_else(|| later.find_map(|line| sent.line(&line)));
            return Err(told(reason, frame));
        }
        count += 1;
    }
    Ok(count)
}
