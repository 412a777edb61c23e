//! A client that keeps a port as busy as the line allows, and counts missing replies.
//!
//! ```text
//!   window of reads ──▶ port ──▶ arm          every eighth request is a write; the arm sends reports at 50 Hz
//!   LoadResult      ◀── port ◀── replies, in the order of the reads, and reports between them
//! ```
//!
//! The port may belong to the simulator, the emulated firmware or an arm.

mod args;
mod client;
mod memory;
mod result;
mod round_trips;

use std::time::{Duration, Instant};

pub use args::{LoadArgs, LoadError};
use client::LoadClient;
pub use result::LoadResult;

/// The period of the progress line and of the memory measurement.
const PROGRESS_PERIOD: Duration = Duration::from_secs(1);

/// Saturates the port for the time in `args`, then waits for the pending replies.
///
/// # Errors
/// See [`LoadError`].
pub fn run(args: &LoadArgs) -> Result<LoadResult, LoadError> {
    let time = Duration::try_from_secs_f64(args.minutes * 60.0);
    let time = time.ok().filter(|time| !time.is_zero()).ok_or(LoadError::Minutes(args.minutes))?;
    let mut client = LoadClient::open(args)?;
    client.start_reports()?;
    let mut next_progress = Instant::now() + PROGRESS_PERIOD;
    while client.elapsed() < time {
        client.fill_window()?;
        client.receive()?;
        client.drop_lost_reads();
        if Instant::now() >= next_progress {
            next_progress += PROGRESS_PERIOD;
            client.measure_memory(args.pid);
            client.show_progress(time);
        }
    }
    client.finish()
}
