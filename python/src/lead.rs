//! Sends the points of a program that does not wait for each of them. The thread of the port keeps the period.
//!
//! ```text
//!   Python: latest(action) ──▶ LatestSlot ──▶ LatestPoints: which point is due ──▶ SetPointStream
//! ```
//!
//! With a real line, the thread wakes up when a point is due. With an arm in virtual time, it sends due points in the calls
//! that let time pass.

use std::sync::atomic::Ordering;
use std::time::Duration;

use sevenbot::approach::{FirstPoints, NEAR_DEGREES};
use sevenbot::fine::FineTargets;
use sevenbot::map::fault;
use sevenbot::moves::{MoveError, Observer};
use sevenbot::stream::LatestStep;

use crate::watch::{Inbox, PacedStream, Watch};

/// The longest time between two checks: does the arm follow, and does its watchdog need a frame?
const LOOK_PERIOD: Duration = Duration::from_millis(20);

impl PacedStream<'_> {
    /// Sends the points that are due, and sets the counts and the failure for the program.
    pub(crate) fn lead(&mut self, inbox: &Inbox) {
        let led = self.send_what_is_due(inbox);
        if led.as_ref().is_err_and(ends_leading) {
            self.points.stop();
        }
        self.note_failure(&led);
        self.slot.tell(self.points.counts(), led.err());
    }

    fn send_what_is_due(&mut self, inbox: &Inbox) -> Result<(), MoveError> {
        self.notice_stops()?;
        if let Some(action) = self.slot.take() {
            let now = self.elapsed();
            if self.points.is_leading() && self.points.is_silent(now) {
                self.ask_watchdog()?;
            }
            self.points.offer(now, &action);
        }
        let mut now = self.elapsed();
        while let Some(step) = self.points.next(now) {
            match step {
                LatestStep::Send(point) => self.send_latest(&point, inbox)?,
                LatestStep::AskWatchdog => self.ask_watchdog()?,
            }
            now = self.elapsed();
        }
        if !self.points.is_silent(now) {
            self.stream.keep_alive()?;
            self.stream.check()?;
        }
        Ok(())
    }

    /// Notes a failure of the whole arm, after which the next point is a first one. A stop and a first point that is far away are
    /// not such failures.
    pub(crate) fn note_failure<T>(&mut self, done: &Result<T, MoveError>) {
        let is_of_arm = |failure: &MoveError| {
            !matches!(failure, MoveError::Interrupted | MoveError::StartTooFar(_)) && ends_leading(failure)
        };
        self.has_failed |= done.as_ref().is_err_and(is_of_arm);
    }

    /// Fails with `Interrupted` if `Arm.stop` was called while the sender leads the arm, and drops the waiting action. Nothing is
    /// sent until the program has received this error.
    fn notice_stops(&mut self) -> Result<(), MoveError> {
        let stops = self.stops.load(Ordering::Relaxed);
        let is_stopped = std::mem::replace(&mut self.stops_before, stops) != stops;
        if is_stopped && self.points.is_leading() {
            self.slot.take();
            self.first = FirstPoints::default();
            return Err(MoveError::Interrupted);
        }
        Ok(())
    }

    fn send_latest(&mut self, point: &FineTargets, inbox: &Inbox) -> Result<(), MoveError> {
        self.begin_again_if_lost()?;
        if std::mem::take(&mut self.is_held) {
            self.stream.begin_again()?;
            self.first = FirstPoints::default();
        }
        if let Some(first) = { self.first }.take(point) {
            let mut watch = Watch::of_no_call(&self.stops, inbox);
            self.approach(&first, &mut watch)?;
            self.first.take(point);
            if self.slot.waiting().is_some_and(|newer| is_far(&newer, point)) {
                // The program went on during the approach, so its newest action is approached, too.
                self.first = FirstPoints::default();
            }
            let now = self.elapsed();
            self.points.restart(now + self.stream.period());
        }
        Ok(self.stream.send(point)?)
    }

    /// Checks whether the watchdog of the arm has acted. If so, the next action is a first one again.
    fn ask_watchdog(&mut self) -> Result<(), MoveError> {
        let status = self.stream.arm().status()?;
        let has_acted = status.is_some_and(|status| status.faults() & fault::HOST_SILENT != 0);
        if has_acted && !self.is_held {
            self.points.watchdog_acted();
            self.is_held = true;
        }
        Ok(())
    }

    /// Waits until the last action is sent. Then the sender ends.
    pub(crate) fn finish_leading(&mut self, watch: &mut Watch<'_>) -> Result<(), MoveError> {
        self.lead(watch.inbox);
        while self.points.has_new() {
            self.sleep(self.stream.period(), watch)?;
        }
        self.points.stop();
        Ok(())
    }

    /// Waits on the clock of the arm's line, and sends what is due meanwhile. If the caller ends the wait, the arm holds.
    pub(crate) fn sleep(&mut self, time: Duration, watch: &mut Watch<'_>) -> Result<(), MoveError> {
        let end = self.elapsed() + time;
        loop {
            self.lead(watch.inbox);
            let now = self.elapsed();
            let left = end.saturating_sub(now);
            if left.is_zero() {
                return Ok(());
            }
            if !watch.goes_on() {
                self.stream.arm().hold()?;
                return Err(MoveError::Interrupted);
            }
            let wakes_at = self.wakes_at().unwrap_or(end);
            let slice = wakes_at.saturating_sub(now).clamp(Duration::from_millis(1), LOOK_PERIOD);
            watch.pause(self.stream.arm(), slice.min(left));
        }
    }

    /// How long the thread may wait for a call; `None`: without a limit, as for an arm in virtual time.
    pub(crate) fn wakes_in(&mut self) -> Option<Duration> {
        let at = self.wakes_at().filter(|_| self.simulation.is_none())?;
        Some(at.saturating_sub(self.elapsed()))
    }

    fn wakes_at(&mut self) -> Option<Duration> {
        let (now, at) = (self.elapsed(), self.points.wake_at()?);
        Some(if self.points.is_silent(now) { at } else { at.min(now + LOOK_PERIOD) })
    }
}

/// Does an angle of a joint in `newer` differ from `point` by more than [`NEAR_DEGREES`]?
fn is_far(newer: &FineTargets, point: &FineTargets) -> bool {
    let both = newer.iter().zip(point).filter_map(|(newer, point)| newer.zip(*point));
    both.map(|(newer, point)| (newer.degrees() - point.degrees()).abs()).any(|way| way > NEAR_DEGREES)
}

/// Does the sender end after this failure? A failure of single joints does not end it: such a joint takes up the stream when
/// it is free (D27).
fn ends_leading(failure: &MoveError) -> bool {
    match failure {
        MoveError::Problems(problems) => problems.iter().any(|problem| problem.joint.is_none()),
        _ => true,
    }
}
