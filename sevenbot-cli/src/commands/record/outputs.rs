//! The outputs of a recording: a text file, an MCAP file, or both.

use std::io::{self, Stdout, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use recording_formats::{McapLayout, McapWriter, Telemetry};
use sevenbot::Health;
use sevenbot::recording::{FileVersion, Moment, RecordingLines};

use crate::command_error::CommandError;
use crate::line_file::LineFile;
use crate::output_file::{ForceArg, OutputFile, is_same, stdout_for};
use crate::printer::note;

/// The user was asked whether existing files may be replaced.
const REPLACE: ForceArg = ForceArg { force: true };

/// The files of a recording. All of them get the same moments.
pub(crate) struct RecordingOutputs {
    lines: RecordingLines,
    /// The moments in the files, and the time of the last one.
    written: (u64, Duration),
    /// The files until the first moment. So existing ones keep their content if nothing is recorded.
    opened: Option<OpenedFiles>,
    text: Option<LineFile>,
    mcap: Option<McapFile>,
    /// The wall-clock time to which the times of the moments are added, since 1970. Set when the first moment is added.
    start: Option<Duration>,
}

struct OpenedFiles {
    text: Option<OutputFile>,
    mcap: Option<McapOutput>,
}

enum McapOutput {
    Stdout(Stdout),
    File(OutputFile),
}

struct McapFile {
    path: PathBuf,
    writer: McapWriter<Box<dyn Write>>,
}

impl RecordingOutputs {
    /// Opens the files, which may replace existing ones.
    pub(crate) fn open(
        text: Option<&Path>,
        mcap: Option<&Path>,
        version: FileVersion,
    ) -> Result<Self, CommandError> {
        if let (Some(text), Some(mcap)) = (text, mcap)
            && is_same(text, mcap)
        {
            return Err(CommandError::file(mcap, "the text and the MCAP recording need two files"));
        }
        let text = text.map(|path| OutputFile::open(path, None, REPLACE)).transpose()?;
        let opened = Some(OpenedFiles { text, mcap: mcap.map(McapOutput::open).transpose()? });
        Ok(Self {
            lines: RecordingLines::new(version),
            written: (0, Duration::ZERO),
            opened,
            text: None,
            mcap: None,
            start: None,
        })
    }

    /// Empties the files, and writes their heads.
    fn begin(&mut self, OpenedFiles { text, mcap }: OpenedFiles) -> Result<(), CommandError> {
        self.mcap = mcap.map(McapFile::begin).transpose()?;
        self.text = text.map(LineFile::begin).transpose()?;
        self.text.as_mut().map_or(Ok(()), |file| file.add(&self.lines.head()))
    }

    /// Adds a moment. Ignores a moment that is less than a millisecond later than the last one.
    pub(crate) fn add(&mut self, moment: &Moment, telemetry: &Telemetry) -> Result<(), CommandError> {
        let Some(line) = self.lines.add(moment) else { return Ok(()) };
        self.opened.take().map_or(Ok(()), |opened| self.begin(opened))?;
        self.text.as_mut().map_or(Ok(()), |file| file.add(&line))?;
        self.written = (self.lines.count(), self.lines.duration());
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
        self.written.0
    }

    /// The time of the last moment.
    pub(crate) const fn duration(&self) -> Duration {
        self.written.1
    }

    /// Finishes the MCAP file. The text file needs no end. Fails if nothing was recorded.
    pub(crate) fn finish(&mut self) -> Result<(), CommandError> {
        if self.opened.is_some() {
            return Err(CommandError::Arm("the recording ended before its first moment".to_owned()));
        }
        self.mcap.as_mut().map_or(Ok(()), |file| file.write(McapWriter::finish))
    }

    /// After a failure, tells the user how much the files hold.
    pub(crate) fn note_what_is_there(&self) {
        if self.opened.is_some() {
            note("nothing was recorded, and no file has changed");
        }
        if let Some(file) = &self.text {
            let (moments, seconds) = (self.count(), self.duration().as_secs_f64());
            note(format_args!(
                "{} is complete up to {seconds:.1} s, {moments} moments",
                file.path().display()
            ));
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

impl McapOutput {
    fn open(path: &Path) -> Result<Self, CommandError> {
        if is_stdout(path) {
            return Ok(Self::Stdout(stdout_for(Some("mcap"))?));
        }
        Ok(Self::File(OutputFile::open(path, None, REPLACE)?))
    }
}

impl McapFile {
    fn begin(output: McapOutput) -> Result<Self, CommandError> {
        let (path, is_file, out): (_, _, Box<dyn Write>) = match output {
            McapOutput::Stdout(stdout) => (PathBuf::from("-"), false, Box::new(stdout)),
            McapOutput::File(file) => {
                (file.path().to_owned(), file.path().is_file(), Box::new(file.begin()?))
            }
        };
        // A pipe is read while it is written, so it needs each message at once.
        let layout = if is_file { McapLayout::Indexed } else { McapLayout::Live };
        let writer = McapWriter::new(out, layout).map_err(|error| failed(&path, error))?;
        Ok(Self { path, writer })
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
