//! Records the joints: the page's shell around [`MoveWatch`] and [`RecordingLines`].

use protocol_core::time::Instant;
use sevenbot::approach::Standing;
use sevenbot::health::{MoveFault, MoveWatch};
use sevenbot::recording::{FileVersion, Moment, RecordingLines};
use sevenbot::{FineAngle, Snapshot};

use crate::client::BAUD;
use crate::stop::since_start;

/// Collects the measured poses of the arm as the text of a recording.
#[derive(Debug)]
pub struct PageRecorder {
    start: Instant,
    lines: RecordingLines,
    text: String,
    watch: MoveWatch,
}

impl PageRecorder {
    /// Begins a recording. `now` is its time 0.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        let lines = RecordingLines::new(FileVersion::Hundredths);
        let watch = MoveWatch::new(since_start(now), 0, BAUD).of_positions();
        Self { start: now, text: lines.head(), lines, watch }
    }

    /// Adds the pose of these registers. Skips it if a joint is not measured, or if less than 1 ms has passed since the last pose.
    ///
    /// # Errors
    /// A servo is silent, or the controller restarted: the registers do not hold the true positions, so the recording has to end.
    pub fn add(&mut self, now: Instant, registers: &Snapshot, vacuum: bool) -> Result<(), MoveFault> {
        self.watch.registers(since_start(now), registers)?;
        let measured = Standing::of(registers).measured.map(|angle| FineAngle::from_degrees(angle?));
        let mut pose = [FineAngle::from(sevenbot::Angle::from_register(0)); 7];
        for (angle, measured) in pose.iter_mut().zip(measured) {
            let Some(measured) = measured else { return Ok(()) };
            *angle = measured;
        }
        let time = since_start(now).saturating_sub(since_start(self.start));
        self.text.extend(self.lines.add(&Moment { time, pose, vacuum }));
        Ok(())
    }

    /// The text of the file; `None` if no pose was added.
    #[must_use]
    pub fn finish(self) -> Option<String> {
        (self.lines.count() > 0).then_some(self.text)
    }
}
