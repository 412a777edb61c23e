//! Streams of set-points in hundredths of a degree, with a watchdog in the arm (D23, D24).
//!
//! ```text
//!   SetPointStream::open ──▶ period and watchdog of this stream ──▶ send, send, ... ──▶ values from before
//!                                                                      ▲                 (also on drop)
//!   StreamPace: when the next point is due ────────────────────────────┤
//!   LatestPoints: what a program that does not wait sends then ────────┘
//! ```
//!
//! If the program dies, the watchdog of the arm acts, unless it is off: [`WatchdogAction`]. A clean end, an error and a panic put
//! the registers back. After a lost connection, a player leaves them to the watchdog.

use std::time::Duration;

use protocol_core::registers::map::{
    FEEDBACK_FREQUENCY, FINE_TARGET, HOST_WATCHDOG, REPORT_CONTENT, SET_POINT_PERIOD, SPEED, WATCHDOG_ACTION,
    fault,
};

use crate::arm::Arm;
use crate::checked_write::{NotTaken, WriteError};
use crate::error::Error;
use crate::fine::fine_frames;
use crate::fine_state::FineTargets;
use crate::health::{MoveCheck, MoveCheckError, MoveState};
use crate::joints::joints_of;
use crate::units::Speed;
use host_link::Span;

mod latest;
mod pace;

pub use latest::{LatestCounts, LatestPoints, LatestStep};
pub use pace::{PaceCounts, StreamPace};

/// The registers that a stream sets: period, time of the watchdog, action of the watchdog.
const STREAM_REGISTERS: Span = Span::between(&SET_POINT_PERIOD, &WATCHDOG_ACTION);
/// The values of these registers without a stream: no set-point period, no watchdog.
const SWITCHED_OFF: [u8; 4] = [0; 4];
/// The unit of the watchdog's time.
const WATCHDOG_STEP: Duration = Duration::from_millis(10);
/// The watchdog acts at the control cycle after its time, and a USB adapter delays the last frame.
const WATCHDOG_MARGIN: Duration = Duration::from_millis(50);

/// What the watchdog of the arm does when the host is silent (D24).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchdogAction {
    /// Each joint holds at its set-point, which becomes its target.
    Hold,
    /// Damping protection: the arm sinks slowly.
    Damping,
}

/// Period and watchdog of a stream.
///
/// ```
/// use sevenbot::stream::StreamOptions;
///
/// assert_eq!(StreamOptions::new(20).map(|options| options.period().as_millis()), Some(20));
/// assert_eq!(StreamOptions::new(4), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamOptions {
    period_ms: u16,
    watchdog: (u8, WatchdogAction),
}

impl StreamOptions {
    /// The time of the watchdog if nothing else is set, in steps of 10 ms.
    pub const WATCHDOG_STEPS: u8 = 30;

    /// A stream with this period in milliseconds, 5 to 1000, and a watchdog that makes the arm hold after 300 ms. `None`
    /// for another period.
    #[must_use]
    pub const fn new(period_ms: u16) -> Option<Self> {
        if period_ms < 5 || period_ms > 1_000 {
            return None;
        }
        Some(Self { period_ms, watchdog: (Self::WATCHDOG_STEPS, WatchdogAction::Hold) })
    }

    /// With another watchdog: its time in steps of 10 ms, 0 for none, and its action.
    #[must_use]
    pub const fn with_watchdog(self, steps: u8, action: WatchdogAction) -> Self {
        Self { watchdog: (steps, action), ..self }
    }

    /// The time between two points, 5 ms to 1 s.
    #[must_use]
    pub const fn period(self) -> Duration {
        Duration::from_millis(self.period_ms as u64)
    }

    /// The values of registers 184 to 187 that begin the stream. Zeros end it.
    #[must_use]
    pub fn registers(self) -> [u8; 4] {
        let [low, high] = self.period_ms.to_le_bytes();
        let (steps, action) = self.watchdog;
        [low, high, steps, u8::from(action == WatchdogAction::Damping)]
    }

    /// The time of the watchdog; `None` if there is none.
    #[must_use]
    pub fn watchdog_time(self) -> Option<Duration> {
        let (steps, _) = self.watchdog;
        (steps > 0).then(|| WATCHDOG_STEP * u32::from(steps))
    }
}

/// Why a stream does not start, or why its registers are not put back.
///
/// ```
/// use sevenbot::stream::StreamError;
///
/// assert!(StreamError::NoExtendedBlock.to_string().contains("whole degrees"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StreamError {
    /// The arm has no extended block.
    #[error("the arm's firmware takes no stream of set-points: it has whole degrees only")]
    NoExtendedBlock,
    /// These registers did not take their values.
    #[error("the arm did not take the stream's registers: {0}")]
    NotTaken(#[source] NotTaken),
    /// An exchange with the arm failed.
    #[error(transparent)]
    Exchange(#[from] Error),
}

impl From<WriteError> for StreamError {
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::NotTaken(not_taken) => Self::NotTaken(not_taken),
            WriteError::Exchange(error) => Self::Exchange(error),
        }
    }
}

/// An open stream. While it lives, the arm takes fine targets as points of a stream, and its watchdog runs if the options
/// set one.
///
/// ```no_run
/// use sevenbot::stream::{SetPointStream, StreamOptions, StreamPace};
/// use sevenbot::{Arm, FineAngle};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut arm = Arm::open("/dev/ttyUSB0", 115_200)?;
/// let options = StreamOptions::new(20).ok_or("a period")?;
/// let mut stream = SetPointStream::open(&mut arm, options)?;
/// let mut pace = StreamPace::new(stream.arm().elapsed(), options.period());
/// for hundredths in (9000..9500).step_by(20) {
///     let now = stream.arm().elapsed();
///     stream.arm().sleep(pace.due().saturating_sub(now));
///     pace.take(now.max(pace.due()));
///     stream.send(&[FineAngle::from_hundredths(hundredths), None, None, None, None, None, None])?;
///     stream.check()?;
/// }
/// stream.close()?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SetPointStream<'a> {
    arm: &'a mut Arm,
    options: StreamOptions,
    /// The values to put back at the end; `None` once they are put back, or left to the watchdog.
    before: Option<Vec<u8>>,
    last_sent: Duration,
    /// Watches over the joints that got a point.
    check: MoveCheck,
}

impl<'a> SetPointStream<'a> {
    /// Sets period and watchdog. No joint begins to move.
    ///
    /// # Errors
    /// The arm has no extended block, does not take the values, or an exchange failed.
    pub fn open(arm: &'a mut Arm, options: StreamOptions) -> Result<Self, StreamError> {
        if !arm.has_extended_block()? {
            return Err(StreamError::NoExtendedBlock);
        }
        let before = registers_before(arm)?;
        let last_sent = arm.elapsed();
        let check = MoveCheck::idle(arm, 0).with_period(options.period_ms);
        let mut stream = Self { arm, options, before: Some(before), last_sent, check };
        stream.arm.write_checked(STREAM_REGISTERS.address(), &options.registers())?;
        stream.last_sent = stream.arm.elapsed();
        Ok(stream)
    }

    /// Sends a point at once. A joint without an angle gets no point.
    ///
    /// # Errors
    /// The port failed. The arm does not answer writes, so a refused point is no error: see
    /// [`StatusBlock`](crate::StatusBlock).
    pub fn send(&mut self, point: &FineTargets) -> Result<(), Error> {
        for (address, values) in fine_frames(point) {
            self.arm.write(address, &values)?;
            self.last_sent = self.arm.elapsed();
        }
        self.check.add_joints(joints_of(point), self.arm);
        Ok(())
    }

    /// Does the arm follow? Asks it up to ten times a second, without waiting for the answer. Waits only after a fault, to read
    /// its cause. Call it at least ten times a second.
    ///
    /// # Errors
    /// A joint of the stream is blocked, let go or silent, a servo has a new alarm, the supply was lost, the controller restarted,
    /// the motors are off, another program stopped the arm, the arm does not answer any more, or the port failed.
    pub fn check(&mut self) -> Result<(), MoveCheckError> {
        self.check.poll(self.arm)
    }

    /// As [`Self::check`], but asks now and waits for the answer.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn check_now(&mut self) -> Result<MoveState, MoveCheckError> {
        self.check.check(self.arm)
    }

    /// See [`MoveWatch::end`](crate::health::MoveWatch::end).
    pub(crate) const fn end_check(&mut self) {
        self.check.end();
    }

    /// Begins anew on an arm that is not where it was, such as a simulated one that was restored: sets period and watchdog again,
    /// and watches over no joint until it gets a point.
    ///
    /// # Errors
    /// The arm does not take the values, or an exchange failed.
    pub fn begin_again(&mut self) -> Result<(), StreamError> {
        self.check = MoveCheck::idle(self.arm, 0).with_period(self.options.period_ms);
        self.arm.write_checked(STREAM_REGISTERS.address(), &self.options.registers())?;
        self.last_sent = self.arm.elapsed();
        Ok(())
    }

    /// The joints that got a point since [`Self::open`] or [`Self::begin_again`], as [`Joint::bit`](crate::Joint::bit)s.
    #[must_use]
    pub const fn joints(&self) -> u8 {
        self.check.joints()
    }

    /// Sends an empty write if the watchdog would act soon: after a third of its time. Call it while no point is due.
    ///
    /// # Errors
    /// The port failed.
    pub fn keep_alive(&mut self) -> Result<(), Error> {
        let is_due = |time| self.arm.elapsed() >= self.last_sent + time / 3;
        if self.options.watchdog_time().is_some_and(is_due) {
            self.arm.write(FINE_TARGET.address, &[])?;
            self.last_sent = self.arm.elapsed();
        }
        Ok(())
    }

    /// The time between two points, 5 ms to 1 s.
    #[must_use]
    pub const fn period(&self) -> Duration {
        self.options.period()
    }

    /// The period and the watchdog with which the stream was opened.
    #[must_use]
    pub const fn options(&self) -> StreamOptions {
        self.options
    }

    /// The arm, for other requests and its reports during the stream.
    pub fn arm(&mut self) -> &mut Arm {
        self.arm
    }

    /// Leaves the registers as they are, because the connection is lost: the watchdog of the arm acts, and
    /// [`Arm::end_abandoned_stream`] of the next program switches the stream off.
    pub(crate) fn leave_to_watchdog(mut self) {
        self.before = None;
    }

    /// Puts the registers back, and verifies them.
    ///
    /// # Errors
    /// An exchange failed, or the arm does not take the values.
    pub fn close(mut self) -> Result<(), StreamError> {
        let Some(before) = self.before.take() else { return Ok(()) };
        Ok(self.arm.write_checked(STREAM_REGISTERS.address(), &before)?)
    }
}

impl Drop for SetPointStream<'_> {
    fn drop(&mut self) {
        if let Some(before) = self.before.take() {
            // Ignore a failure: after an error the connection may be lost.
            let _ = self.arm.write(STREAM_REGISTERS.address(), &before);
        }
    }
}

impl Arm {
    /// Switches off the set-point period and the watchdog of a stream whose program is gone: the watchdog has acted, and no
    /// program has written it since. Otherwise the watchdog would stop the moves of programs that do not send all the time.
    /// Also switches reports off, and sets speeds that the stream left at the maximum to their default: otherwise the arm would
    /// approach the next target at 372 degrees/s. Returns whether there was such a stream.
    ///
    /// # Errors
    /// As [`Arm::write_checked`]: the period or the watchdog may still be on.
    pub fn end_abandoned_stream(&mut self) -> Result<bool, WriteError> {
        let is_abandoned = is_left_behind(self)? && self.has_extended_block()?;
        if is_abandoned {
            put_speeds_right(self)?;
            self.write_checked(STREAM_REGISTERS.address(), &SWITCHED_OFF)?;
        }
        Ok(is_abandoned)
    }

    /// Sends nothing for the time of the arm's watchdog, so that it acts unless another program sends (D24). Then
    /// [`Arm::end_abandoned_stream`] finds the stream of a program that was killed a moment ago. Does not wait if the arm has no
    /// watchdog, or if it is off or has acted.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn let_watchdog_act(&mut self) -> Result<(), Error> {
        if !self.has_extended_block()? || is_left_behind(self)? {
            return Ok(());
        }
        let steps = self.read_span(Span::of(&HOST_WATCHDOG))?.byte(&HOST_WATCHDOG);
        if steps > 0 {
            self.sleep(WATCHDOG_STEP * u32::from(steps) + WATCHDOG_MARGIN);
        }
        Ok(())
    }
}

/// Sets speeds at the maximum to their default, and switches reports off.
fn put_speeds_right(arm: &mut Arm) -> Result<(), WriteError> {
    let mut speeds = arm.read_span(Span::of(&SPEED))?.values;
    for (speed, default) in speeds.iter_mut().zip(SPEED.default_bytes()) {
        if *speed == Speed::MAXIMUM.steps() {
            *speed = default;
        }
    }
    let no_reports = [FEEDBACK_FREQUENCY, REPORT_CONTENT].map(|row| (row.address, vec![0]));
    arm.write_all_checked(&[&[(SPEED.address, speeds)][..], &no_reports].concat())
}

/// Has the watchdog acted, and has no program written it since?
fn is_left_behind(arm: &mut Arm) -> Result<bool, Error> {
    Ok(arm.status()?.is_some_and(|status| status.faults() & fault::HOST_SILENT != 0))
}

/// The values to put back at the end. If the watchdog has acted, the program that set the registers is gone: then the values
/// are [`SWITCHED_OFF`].
fn registers_before(arm: &mut Arm) -> Result<Vec<u8>, Error> {
    if is_left_behind(arm)? {
        return Ok(SWITCHED_OFF.to_vec());
    }
    Ok(arm.read_span(STREAM_REGISTERS)?.values)
}
