//! How the hub holds the arm: the brake first, then the steps of [`ArmHold`]. Once the arm has confirmed the hold, the hub
//! restores the set-point period and the speeds.
//!
//! ```text
//!   read the speeds, write 1, read ──▶ no reply: again, every 100 ms
//!     └─▶ a reply: the steps of the hold ──▶ the arm holds ──▶ restore period and speeds, until they are read back
//! ```
//!
//! The hub needs a reply to know where the arm has to hold, and replies may be lost. So it slows all joints down before the
//! first reply. If the reply with the speeds is lost, the hub still knows them: it read them when it found the arm, and all
//! writes pass through it.

use protocol_core::registers::map::{MOTOR_STATE, SET_POINT_PERIOD, SPEED, motor_state};
use protocol_core::registers::{JOINTS, Map};
use protocol_core::time::Instant;

use super::Hub;
use super::arm_hold::{ArmHold, RegisterWrite, Restoring, joined};
use super::intent::Intent;
use super::known_registers::KnownRegisters;
use super::line::Owner;
use super::watchdog::WatchdogAction;

/// The slowest speed, 1.9 degrees/s. It acts on a move in progress ([D11](protocol_core::decisions#d11)), and bounds streams
/// ([D23](protocol_core::decisions#d23)).
const BRAKE: u8 = 1;

/// The state of an arm after a hold of the hub.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HoldOutcome {
    /// Its joints hold where they are.
    Holds,
    /// Its motors are damped or off.
    Limp,
    /// It has not confirmed the hold: it may be moving.
    Unconfirmed,
    /// It holds, or its motors are damped or off. It has not taken back the set-point period or the speeds from before the
    /// hold.
    NotRestored,
}

impl Hub {
    /// Begins to hold the arm. If a hold is in progress and does not restore yet, another one follows it instead.
    pub(super) fn start_hold(&mut self) {
        self.hold_outcome = None;
        if let Some(hold) = self.hold.as_mut().filter(|hold| hold.restoring().is_none()) {
            return hold.want_again();
        }
        self.line.cancel_reads(Owner::Hold);
        let is_streaming = self.known.word(SET_POINT_PERIOD.address) != 0;
        self.hold = Some(ArmHold::new(self.known.is_ours(), is_streaming));
    }

    /// Is a hold of the hub in progress?
    #[must_use]
    pub const fn is_holding(&self) -> bool {
        self.hold.is_some()
    }

    /// The outcome of the last hold of the hub since the port was opened; `None`: it has not ended, or there was none.
    #[must_use]
    pub const fn hold_outcome(&self) -> Option<HoldOutcome> {
        self.hold_outcome
    }

    /// The outcome of a hold that failed since the last call.
    pub const fn take_failed_hold(&mut self) -> Option<HoldOutcome> {
        self.failed_hold.take()
    }

    fn end_hold(&mut self, outcome: HoldOutcome) {
        self.hold_outcome = Some(outcome);
        if matches!(outcome, HoldOutcome::Unconfirmed | HoldOutcome::NotRestored) {
            self.failed_hold = Some(outcome);
        }
        self.news.extend(self.clients.keys());
    }

    /// Carries out the action of a client's watchdog.
    pub(super) fn act(&mut self, now: Instant, action: WatchdogAction) {
        match action {
            WatchdogAction::Hold => self.start_hold(),
            WatchdogAction::Damp => {
                self.note_targets(Intent::MotorsOff, Map::V22, MOTOR_STATE.address, &[]);
                self.write_arm(now, MOTOR_STATE.address, &[motor_state::DAMPING]);
            }
        }
    }

    /// Sends the next frames of the hold in progress.
    pub(super) fn send_hold(&mut self, now: Instant) {
        let Some(hold) = &mut self.hold else { return };
        let Some((address, count)) = hold.next_read(now) else { return };
        if self.line.is_stuck() {
            return;
        }
        if hold.take_brake() {
            // `known` keeps the speeds from before.
            self.is_slowed = true;
            self.line.send_read(now, Owner::Speeds, SPEED.address, SPEED.count);
            self.line.send_write(now, Map::V22, SPEED.address, &[BRAKE; JOINTS]);
        }
        self.line.send_read(now, Owner::Hold, address, count);
    }

    /// Notes the speeds that were read directly before a brake. The speeds in `known` may be out of date, because the hub does
    /// not notice each restart of the arm.
    pub(super) fn note_speeds(&mut self, found: &[u8]) {
        let speeds = restored(found, self.known.speeds());
        self.known.set_speeds(&speeds);
    }

    /// Writes registers for the hub itself, and notes them in `known`.
    fn write_arm(&mut self, now: Instant, address: u8, values: &[u8]) {
        self.known.write(Map::V22, address, values);
        self.line.send_write(now, Map::V22, address, values);
    }

    /// Takes a reply for the hold in progress. Cancels its other pending reads: they were sent before the frames that follow.
    pub(super) fn continue_hold(&mut self, now: Instant, address: u8, values: &[u8]) {
        let Some(mut hold) = self.hold.take() else { return };
        self.line.cancel_reads(Owner::Hold);
        if let Some(what) = hold.restoring() {
            return self.restore(now, hold, what, address, values);
        }
        let frames = hold.frames(address, values, &self.held);
        self.write_targets(now, &frames);
        match hold.is_over() {
            false => self.hold = Some(hold),
            true if hold.is_wanted_again() => self.start_hold(),
            true if let Some(next) = hold.for_unmeasured() => self.hold = Some(next),
            true if hold.is_confirmed() => {
                let first = if self.is_period_changed { Restoring::Period } else { Restoring::Speeds };
                self.hold = Some(hold.restore(first));
            }
            // The joints stay slow: the arm may be moving.
            true => self.end_hold(HoldOutcome::Unconfirmed),
        }
    }

    /// Writes the targets that hold the arm. A set-point period would delay them, so it is 0 meanwhile. The maker's firmware
    /// has no period.
    fn write_targets(&mut self, now: Instant, frames: &[RegisterWrite]) {
        let period = self.known.word(SET_POINT_PERIOD.address);
        let is_delayed = !frames.is_empty() && period != 0 && self.known.is_ours();
        if is_delayed {
            self.is_period_changed = true;
            self.line.send_write(now, Map::V22, SET_POINT_PERIOD.address, &[0, 0]);
        }
        for (address, values) in frames {
            self.note_targets(Intent::Hold, Map::V22, *address, values);
            self.write_arm(now, *address, values);
        }
        if is_delayed {
            self.line.send_write(now, Map::V22, SET_POINT_PERIOD.address, &period.to_le_bytes());
        }
    }

    /// The arm holds: restores what the hold changed, until a reply confirms it or it was tried often enough.
    fn restore(&mut self, now: Instant, mut hold: ArmHold, what: Restoring, address: u8, values: &[u8]) {
        let frames = match what {
            Restoring::Period => self.period_to_restore(values),
            Restoring::Speeds => self.speeds_to_restore(address, values),
        };
        if !frames.is_empty() && !hold.is_over() {
            for (address, values) in &frames {
                self.line.send_write(now, Map::V22, *address, values);
            }
            hold.verify();
            self.hold = Some(hold);
            return;
        }
        let is_changed = !frames.is_empty();
        if is_changed {
            hold.give_up_restoring();
        }
        match what {
            Restoring::Period => {
                self.is_period_changed = is_changed;
                self.hold = Some(hold.restore(Restoring::Speeds));
            }
            Restoring::Speeds => {
                self.is_slowed = is_changed;
                self.end_hold(outcome(&hold, address, values));
            }
        }
    }

    /// The frame that restores the set-point period of the clients; none if the arm has this period.
    fn period_to_restore(&self, found: &[u8]) -> Vec<RegisterWrite> {
        let wanted = self.known.word(SET_POINT_PERIOD.address).to_le_bytes();
        (found != wanted).then(|| (SET_POINT_PERIOD.address, wanted.to_vec())).into_iter().collect()
    }

    /// The frames that restore the speeds of the joints that still have the speed of the brake. A client may have written the
    /// other speeds since.
    fn speeds_to_restore(&self, address: u8, values: &[u8]) -> Vec<RegisterWrite> {
        let found = (address..=u8::MAX).zip(values).filter(|(register, _)| SPEED.holds(*register));
        let is_slow =
            found.filter(|&(register, speed)| *speed == BRAKE && self.known.byte(register) != BRAKE);
        joined(is_slow.map(|(register, _)| (register, vec![self.known.byte(register)])))
    }

    /// In a reply to a client, replaces the temporary values of a hold by the values from before the hold. Otherwise a
    /// client would remember the temporary values, and restore them later.
    pub(super) fn overlay_changed(&self, address: u8, values: &mut [u8]) {
        if self.hold.is_none() {
            return;
        }
        let is_changed =
            |register| SPEED.holds(register) || (self.is_period_changed && SET_POINT_PERIOD.holds(register));
        for (register, value) in (address..=u8::MAX).zip(values).filter(|(register, _)| is_changed(*register))
        {
            *value = self.known.byte(register);
        }
    }

    /// An arm was found; `before` are the registers of the last one. If a hold of the same arm was interrupted, its joints may
    /// be slow: it is held anew, and that restores their speeds.
    pub(super) fn find_again(&mut self, before: &KnownRegisters) {
        let is_same = self.known.chip_id() == before.chip_id();
        if !is_same {
            self.hold = None;
        }
        let speeds = restored(self.known.speeds(), before.speeds());
        let was_slowed = std::mem::take(&mut self.is_slowed);
        let was_period_changed = std::mem::take(&mut self.is_period_changed);
        if was_slowed && is_same && speeds != self.known.speeds() {
            self.known.set_speeds(&speeds);
            let period = before.word(SET_POINT_PERIOD.address).to_le_bytes();
            self.known.write(Map::V22, SET_POINT_PERIOD.address, &period);
            (self.is_slowed, self.is_period_changed) = (true, was_period_changed);
            self.start_hold();
        }
    }
}

/// The outcome of a hold, from its last reply, which has the motor state.
fn outcome(hold: &ArmHold, address: u8, values: &[u8]) -> HoldOutcome {
    let place = MOTOR_STATE.address.checked_sub(address).map(usize::from);
    match place.and_then(|place| values.get(place)) {
        _ if hold.is_unrestored() => HoldOutcome::NotRestored,
        Some(&motor_state::SERVO) => HoldOutcome::Holds,
        _ => HoldOutcome::Limp,
    }
}

/// The speeds in `found`, with the speed of the brake replaced by the speed in `before`. A joint with another speed keeps it:
/// it did not get the brake, got a speed of a client since, or belongs to an arm that restarted.
fn restored(found: &[u8], before: &[u8]) -> Vec<u8> {
    let rows = found.iter().zip(before);
    rows.map(|(&found, &before)| if found == BRAKE { before } else { found }).collect()
}
