//! The fault of a running servo: its effect on answers, when it restarts the servo, and how often it took effect.

use motion_core::servo_bus::frame::ServoFrameBuffer;
use protocol_core::time::{Duration, Instant};

use super::fault::ServoFault;
use crate::fault_count::FaultCount;

/// The damage of [`ServoFault::Garbled`] to a checksum.
const DAMAGE: u8 = 0x55;

/// The fault of a servo, if it has one, with its timer and the number of its effects.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct FaultState {
    fault: Option<ServoFault>,
    /// When [`ServoFault::Restarting`] restarts the servo.
    restarts_at: Instant,
    /// Number of answers since the servo's start.
    answers: u32,
    count: FaultCount,
}

impl FaultState {
    pub(super) const fn new() -> Self {
        Self {
            fault: None,
            restarts_at: Instant::FAR_FUTURE,
            answers: 0,
            count: FaultCount { effects: 0, occasions: 0 },
        }
    }

    /// Sets or removes the fault at `now`, and resets the count.
    pub(super) fn set(&mut self, now: Instant, fault: Option<ServoFault>) {
        self.fault = fault;
        self.count = FaultCount::default();
        self.plan_restart(now);
    }

    /// Resets the number of answers at a start of the servo.
    pub(super) const fn start(&mut self) {
        self.answers = 0;
    }

    fn plan_restart(&mut self, now: Instant) {
        self.restarts_at = match self.fault {
            Some(ServoFault::Restarting(every)) => now + every,
            _ => Instant::FAR_FUTURE,
        };
    }

    /// Does the fault restart the servo at `now`? If so, counts the restart and plans the next one.
    pub(super) fn takes_restart(&mut self, now: Instant) -> bool {
        let is_due = now >= self.restarts_at;
        if is_due {
            self.count.count(true);
            self.plan_restart(now);
        }
        is_due
    }

    /// When the fault restarts the servo next; [`Instant::FAR_FUTURE`] if it never does.
    pub(super) const fn restarts_at(&self) -> Instant {
        self.restarts_at
    }

    pub(super) fn is_missing(&self) -> bool {
        self.fault == Some(ServoFault::Missing)
    }

    pub(super) fn is_stuck(&self) -> bool {
        self.fault == Some(ServoFault::Stuck)
    }

    /// Counts a frame to the servo while it is missing.
    pub(super) fn count_frame(&mut self) {
        if self.is_missing() {
            self.count.count(true);
        }
    }

    /// Counts steps of a millisecond while the servo is stuck. `would_turn`: without the fault it would turn.
    pub(super) fn count_steps(&mut self, steps: u32, would_turn: bool) {
        if self.is_stuck() {
            self.count.count_many(steps.into(), would_turn);
        }
    }

    /// Applies the fault to an answer. Returns how much later than usual the answer is sent.
    pub(super) fn inject(&mut self, bytes: &mut ServoFrameBuffer) -> Duration {
        self.answers = self.answers.wrapping_add(1);
        match self.fault {
            Some(ServoFault::Late(by)) => {
                self.count.count(true);
                by
            }
            Some(ServoFault::Garbled(every)) => {
                let is_garbled = self.answers.is_multiple_of(every);
                self.count.count(is_garbled);
                bytes.last_mut().filter(|_| is_garbled).into_iter().for_each(|checksum| *checksum ^= DAMAGE);
                Duration::ZERO
            }
            _ => Duration::ZERO,
        }
    }

    /// How often the fault took effect since it was set.
    pub(super) const fn count(&self) -> FaultCount {
        self.count
    }
}
