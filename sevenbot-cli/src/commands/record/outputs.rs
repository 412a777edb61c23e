//! The outputs of a recording: a text file, an MCAP file, or both.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use recording_formats::{McapLayout, McapWriter, Telemetry};
use sevenbot::Health;
use sevenbot::recording::{FileVersion, Moment, RecordingLines};

use crate::command_error::CommandError;
use crate::line_file::LineFile;
use crate::output_file::{is_same, stdout_for};
use crate::printer::note;

/// The files of a recording. All of them get the same moments.
pub(crate) struct Outputs {
    lines: RecordingLines,
    text: Option<(PathBuf, LineFile)>,
    mcap: Option<McapFile>,
    /// The wall-clock time to which the times of the moments are added, since 1970. Set when the first moment is added.
    start: Option<Duration>,
}

struct McapFile {
    path: PathBuf,
    writer: McapWriter<Box<dyn Write>>,
}

impl Outputs {
    /// Creates the files, or empties existing ones, and writes their heads.
    pub(crate) fn create(
        text: Option<&Path>,
        mcap: Option<&Path>,
        version: FileVersion,
    ) -> Result<Self, CommandError> {
        if let (Some(text), Some(mcap)) = (text, mcap)
            && is_same(text, mcap)
        {
            return Err(CommandError::file(mcap, "the text and the MCAP recording need two files"));
        }
        let lines = RecordingLines::new(version);
        let mut text =
            text.map(|path| Ok::<_, CommandError>((path.to_owned(), LineFile::create(path)?))).transpose()?;
        if let Some((_, file)) = &mut text {
            file.add(&lines.head())?;
        }
        Ok(Self { lines, text, mcap: mcap.map(McapFile::create).transpose()?, start: None })
    }

    /// Does a file take telemetry besides poses? Only MCAP does.
    pub(crate) const fn has_telemetry(&self) -> bool {
        self.mcap.is_some()
    }

    /// Adds a moment. Ignores a moment that is less than a millisecond later than the last one.
    pub(crate) fn add(&mut self, moment: &Moment, telemetry: &Telemetry) -> Result<(), CommandError> {
        let Some(line) = self.lines.add(moment) else { return Ok(()) };
        if let Some((_, file)) = &mut self.text {
            file.add(&line)?;
        }
        let at = self.start() + moment.time;
        self.mcap.as_mut().map_or(Ok(()), |file| file.write(|writer| writer.add(at, moment, telemetry)))
    }

    /// Adds the health of the arm at this port, at the time of a moment.
    pub(crate) fn diagnose(
        &mut self,
        time: Duration,
        health: &Health,
        port: &str,
    ) -> Result<(), CommandError> {
        let at = self.start() + time;
        self.mcap.as_mut().map_or(Ok(()), |file| file.write(|writer| writer.diagnose(at, health, port)))
    }

    pub(crate) const fn count(&self) -> u64 {
        self.lines.count()
    }

    /// The time of the last moment.
    pub(crate) fn duration(&self) -> Duration {
        self.lines.duration()
    }

    /// Finishes the MCAP file. The text file needs no end.
    pub(crate) fn finish(&mut self) -> Result<(), CommandError> {
        self.mcap.as_mut().map_or(Ok(()), |file| file.write(McapWriter::finish))
    }

    /// After a failure, tells the user how much the files hold.
    pub(crate) fn note_what_is_there(&self) {
        if let Some((path, _)) = &self.text {
            let (moments, seconds) = (self.count(), self.duration().as_secs_f64());
            note(format_args!("{} is complete up to {seconds:.1} s, {moments} moments", path.display()));
        }
        if let Some(McapFile { path, writer }) = &self.mcap {
            let place = if is_stdout(path) { "standard output".into() } else { path.display().to_string() };
            let moments = match writer.written() {
                0 => "no whole moment".to_owned(),
                1 => "the first moment".to_owned(),
                count => format!("the first {count} moments"),
            };
            note(format_args!("{place} has {moments}"));
        }
    }

    fn start(&mut self) -> Duration {
        *self.start.get_or_insert_with(|| {
            SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
        })
    }
}

impl McapFile {
    fn create(path: &Path) -> Result<Self, CommandError> {
        let out: Box<dyn Write> = match is_stdout(path) {
            true => Box::new(stdout_for(Some("mcap"))?),
            false => Box::new(File::create(path).map_err(|error| CommandError::file(path, error))?),
        };
        // A pipe is read while it is written, so it needs each message at once.
        let layout = if path.is_file() { McapLayout::Indexed } else { McapLayout::Live };
        let writer = McapWriter::new(out, layout).map_err(|error| failed(path, error))?;
        Ok(Self { path: path.to_owned(), writer })
    }

    fn write(
        &mut self,
        write: impl FnOnce(&mut McapWriter<Box<dyn Write>>) -> io::Result<()>,
    ) -> Result<(), CommandError> {
        write(&mut self.writer).map_err(|error| failed(&self.path, error))
    }
}

fn failed(path: &Path, error: io::Error) -> CommandError {
    if is_stdout(path) { CommandError::Output(error) } else { CommandError::file(path, error) }
}

/// Is this the name of standard output?
pub(crate) fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}
