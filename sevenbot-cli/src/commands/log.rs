//! `log`: watches an arm, and writes all bytes to and from it to a file.

use std::fs;
use std::path::PathBuf;

use clap::{Args, value_parser};

use super::monitor;
use crate::command_error::CommandError;
use crate::printer::note;
use crate::session::Session;

/// Watch the arm, and write all bytes to and from it, with times, to a new file.
///
/// Reads what `monitor` reads, moves nothing, and warns of obstacles and alarms. Ctrl-C ends it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot log day1.log
  sevenbot log day1.log --hz 50 --seconds 60
  sevenbot sniff day1.log               shows it as text, frame by frame
  sevenbot --log run.log play wave.txt  logs what another command says

Lines of the file are those of `host-sim --record`: microseconds, direction,
bytes.

Exit status 0 after Ctrl-C or --seconds, 1 if the file cannot be written, 3 if
the arm is gone. The file has what was said before.")]
pub(crate) struct LogArgs {
    /// The new file.
    file: PathBuf,
    /// Samples per second.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = value_parser!(u8).range(1..=50))]
    hz: u8,
    /// End after N seconds.
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..))]
    seconds: Option<u32>,
}

pub(crate) fn run(session: &mut Session, args: &LogArgs) -> Result<(), CommandError> {
    if session.log.replace(args.file.clone()).is_some() {
        return Err(CommandError::Usage("`log` writes its own FILE: leave --log out".to_owned()));
    }
    let mut arm = session.connect()?;
    let count = args.seconds.map_or(u64::MAX, |seconds| u64::from(seconds) * u64::from(args.hz));
    let mut written = 0;
    let ended = monitor::each_sample(&mut arm, monitor::period(args.hz), count, |_| {
        let length = fs::metadata(&args.file).map_err(|error| CommandError::file(&args.file, error))?.len();
        // The log stops without an error when the disk is full. So check that the file grows.
        if length <= written {
            return Err(CommandError::file(&args.file, "the log has stopped growing: is the disk full?"));
        }
        written = length;
        Ok(())
    });
    note(format_args!("{written} bytes in {}", args.file.display()));
    ended
}
