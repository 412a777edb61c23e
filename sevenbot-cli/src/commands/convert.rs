//! `convert`: converts a recording to another format.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use recording_formats::{Format, ReadError, convert};
use serde::Serialize;

use crate::command_error::CommandError;
use crate::input_file;
use crate::output_file::{ForceArg, OutputFile, stdout_for};
use crate::printer::Printable;
use crate::session::Session;

/// Convert a recording: text, CSV or MCAP.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot convert wave.txt wave.mcap      for Rerun and ROS 2
  sevenbot convert wave.txt wave.csv       for a spreadsheet
  sevenbot convert run.mcap run.txt        then `sevenbot play run.txt`
  sevenbot convert run.mcap - --to csv     to standard output
  sevenbot convert cut.mcap whole.mcap     an end for a file of a killed program

Needs no arm. The end of OUTPUT's name tells its format:
  .txt   text, as `sevenbot record` writes it: degrees
  .csv   the same columns with names and commas: degrees
  .mcap  messages of ROS 2: radians, names of the joints as in `sevenbot model`

The first bytes of INPUT tell its format. Of an MCAP file the topic joint_states
is converted, also of a bag of this project's ROS 2 node. Velocities, loads and
targets are in MCAP files of `sevenbot record --mcap`, and in no other format.

Of a file that is cut off or damaged, what can be read is converted, and exit
status 1 says so. From MCAP to MCAP all topics are kept.")]
pub(crate) struct ConvertArgs {
    /// The recording; - is standard input.
    input: PathBuf,
    /// The file to write; - is standard output.
    output: PathBuf,
    /// The format, if OUTPUT's name does not tell it.
    #[arg(long, value_name = "FORMAT")]
    to: Option<FormatName>,
    #[command(flatten)]
    force: ForceArg,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FormatName {
    Txt,
    Csv,
    Mcap,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Txt => Self::Text,
            FormatName::Csv => Self::Csv,
            FormatName::Mcap => Self::Mcap,
        }
    }
}

#[derive(Debug, Serialize)]
struct Converted {
    file: String,
    moments: usize,
    seconds: f64,
}

impl Printable for Converted {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}: {} moments in {:.1} s", self.file, self.moments, self.seconds)
    }
}

pub(crate) fn run(session: &mut Session, args: &ConvertArgs) -> Result<(), CommandError> {
    let format = format(args)?;
    let is_stdout = args.output.as_os_str() == "-";
    let file = (!is_stdout).then(|| OutputFile::open(&args.output, Some(&args.input), args.force));
    let file = file.transpose()?;
    let mut stdout = stdout_for((is_stdout && format == Format::Mcap).then_some("mcap"))?;
    let mut bytes = Vec::new();
    let (recording, damage) = match convert(input_file::open(&args.input)?, format, &mut bytes) {
        Ok(recording) => (recording, None),
        Err(ReadError::Damaged { readable, cause }) => (readable, Some(cause)),
        Err(error) => return Err(CommandError::file(&args.input, error)),
    };
    match file {
        None => {
            stdout.write_all(&bytes)?;
            stdout.flush()?;
        }
        Some(file) => {
            file.write(&bytes)?;
            let moments = recording.moments().count();
            let (file, seconds) = (args.output.display().to_string(), recording.duration().as_secs_f64());
            session.printer.print(&Converted { file, moments, seconds })?;
        }
    }
    let failed = |cause| CommandError::file(&args.input, format!("{cause}: what can be read was converted"));
    damage.map_or(Ok(()), |cause| Err(failed(cause)))
}

fn format(args: &ConvertArgs) -> Result<Format, CommandError> {
    args.to.map(Format::from).or_else(|| Format::of_name(&args.output)).ok_or_else(|| {
        let ends = Format::ALL.map(Format::extension).join(", ");
        CommandError::Usage(format!(
            "the name {} tells no format: give it an end ({ends}) or use --to",
            args.output.display()
        ))
    })
}
