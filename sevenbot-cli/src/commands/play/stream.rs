//! Plays a recording as a stream of points in hundredths of a degree (D23).

use std::time::{Duration, Instant};

use sevenbot::map::{SPEED, VACUUM_PUMP};
use sevenbot::stream::{SetPointStream, StreamError, StreamOptions, StreamPace};
use sevenbot::{Arm, Speed};

use super::{PLOT_TAIL, Player};
use crate::command_error::CommandError;
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use crate::write_result::all_taken;

/// Time between two points, in milliseconds.
const PERIOD_MS: u16 = 20;

impl Player {
    /// Streams all points once, from where the arm is: at the first of them.
    pub(super) fn stream(&mut self, arm: &mut Arm, interrupt: Interrupt) -> Result<(), CommandError> {
        let options = StreamOptions::new(PERIOD_MS).ok_or(StreamError::NoExtendedBlock)?;
        // The points tell the speed. The file was checked, and the arm is at its first pose.
        all_taken(&arm.write_checked(SPEED.address, &[Speed::MAXIMUM.steps(); 7])?)?;
        let mut stream = SetPointStream::open(arm, options)?;
        stream.arm().reports().for_each(drop);
        let (mut path, period) = (self.path.clone(), options.period());
        let points = path.duration().as_millis().div_ceil(period.as_millis().max(1));
        let progress = Progress::new(u64::try_from(points).unwrap_or(u64::MAX), "points");
        let start = Instant::now();
        self.last_report = start;
        let mut pace = StreamPace::new(start, period);
        let mut vacuum = self.moments.first().is_some_and(|first| first.vacuum);
        let mut time = Duration::ZERO;
        while pace.counts().points == 0 || time < path.duration() {
            self.take_reports_until(
                start,
                pace.due().saturating_duration_since(start),
                stream.arm(),
                interrupt,
            )?;
            let number = pace.take(Instant::now());
            time = period.saturating_mul(number);
            let Some(point) = path.at(time) else { break };
            if point.vacuum != vacuum {
                vacuum = point.vacuum;
                stream.arm().write(VACUUM_PUMP.address, &[u8::from(vacuum)])?;
            }
            stream.send(&point.pose.map(Some))?;
            progress.set(number.into());
        }
        self.take_reports_until(start, time + 2 * period + PLOT_TAIL, stream.arm(), interrupt)?;
        Ok(stream.close()?)
    }
}
