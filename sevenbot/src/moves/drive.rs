//! The blocking shell round a [`MovementRun`]: carries out its steps, and waits between them.

use std::time::Duration;

use super::error::MoveError;
use super::observer::{Observer, Stage};
use crate::arm::Arm;
use crate::movement_run::{MovementRun, RunStep};
use crate::stream::SetPointStream;

/// The longest wait between two calls of the observer.
pub(super) const POLL_PERIOD: Duration = Duration::from_millis(20);

/// Where the steps of a run go.
pub(super) trait StepSink {
    fn arm(&mut self) -> &mut Arm;

    /// Sends a point or a frame. A stream also checks whether the arm follows.
    fn carry_out(&mut self, step: &RunStep) -> Result<(), MoveError>;
}

impl StepSink for Arm {
    fn arm(&mut self) -> &mut Arm {
        self
    }

    fn carry_out(&mut self, step: &RunStep) -> Result<(), MoveError> {
        for (address, values) in step.frames() {
            self.write(address, &values)?;
        }
        Ok(())
    }
}

impl StepSink for SetPointStream<'_> {
    fn arm(&mut self) -> &mut Arm {
        SetPointStream::arm(self)
    }

    fn carry_out(&mut self, step: &RunStep) -> Result<(), MoveError> {
        match step {
            RunStep::Point(point) => self.send(point)?,
            other => SetPointStream::arm(self).carry_out(other)?,
        }
        Ok(self.check()?)
    }
}

/// Drives a run to its end. `wait` waits until a time, and fails if the observer ends the run.
pub(super) fn drive<S: StepSink>(
    mut run: MovementRun,
    sink: &mut S,
    observer: &mut dyn Observer,
    mut wait: impl FnMut(&mut S, Duration, &mut dyn Observer) -> Result<(), MoveError>,
) -> Result<(), MoveError> {
    loop {
        match run.poll(sink.arm().elapsed()) {
            RunStep::Wait(until) => wait(sink, until, observer)?,
            RunStep::Over => return Ok(()),
            RunStep::Paused(time) => return Err(MoveError::Paused { time }),
            step => {
                sink.carry_out(&step)?;
                let (reached, total) = run.progress();
                observer.progress(Stage::Playing, reached, total);
            }
        }
    }
}
