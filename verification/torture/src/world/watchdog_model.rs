//! When the watchdog of the host link may act, and when it must have acted (D24).

use protocol_core::registers::RegisterFile;
use protocol_core::registers::map::{FAULTS, MOTOR_STATE, MOVING_JOINTS, fault, motor_state};
use protocol_core::time::{Duration, Instant};

use super::extended_model::WATCHDOG_ACTION;
use crate::violation::{Check, ensure};

/// The watchdog acts within 10 ms. A control cycle and a late wake-up of the shell add to this.
const ACTS_WITHIN: Duration = Duration::from_millis(30);

/// The watchdog of the host link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WatchdogModel {
    timeout: Duration,
    /// The watchdog acts at this time unless a request arrives earlier; `None` while it is off.
    due: Option<Instant>,
    /// True if a silence was long enough since register 186 was written.
    may_have_acted: bool,
}

impl WatchdogModel {
    /// The watchdog of an arm after its start: off.
    pub(crate) const OFF: Self = Self { timeout: Duration::ZERO, due: None, may_have_acted: false };

    /// Register 186 was written: the time begins, and the fault bit is cleared.
    pub(crate) fn set(&mut self, now: Instant, value: u8) {
        *self = Self { timeout: Duration::from_millis(u64::from(value) * 10), ..Self::OFF };
        self.heard(now);
    }

    /// A well-formed request had its turn.
    pub(crate) fn heard(&mut self, now: Instant) {
        self.due = (self.timeout > Duration::ZERO).then(|| now + self.timeout);
    }

    /// True if the watchdog may have acted in this silence.
    pub(crate) fn may_act(&mut self, now: Instant) -> bool {
        let may_act = self.due.is_some_and(|due| due <= now);
        self.may_have_acted |= may_act;
        may_act
    }

    /// Checks that fault bit 6 is set only after a silence.
    pub(crate) fn check_fault(&self, registers: &RegisterFile) -> Check {
        let is_set = registers.get(FAULTS.address) & fault::HOST_SILENT != 0;
        ensure(!is_set || self.may_have_acted, || "the watchdog acted without a silence".to_owned())
    }

    /// Checks that the watchdog has acted if the silence is long enough. The shell has run without a stall since
    /// `unsettled_at`. The joints in the bits of `own` may be moving for another reason, such as an obstacle.
    pub(crate) fn check(
        &self,
        now: Instant,
        unsettled_at: Instant,
        own: u8,
        registers: &RegisterFile,
    ) -> Check {
        let is_due = self.due.is_some_and(|due| due.max(unsettled_at) + ACTS_WITHIN < now);
        let is_set = registers.get(FAULTS.address) & fault::HOST_SILENT != 0;
        let is_damped = registers.get(MOTOR_STATE.address) == motor_state::DAMPING;
        let has_acted = match registers.get(WATCHDOG_ACTION) {
            0 => registers.get(MOVING_JOINTS.address) & !own == 0,
            _ => is_damped,
        };
        ensure(!is_due || (is_set && has_acted), || {
            format!("the watchdog did not act: fault bit {is_set}, its effect {has_acted}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_watchdog_may_act_after_a_silence_and_must_act_soon() {
        let at = |millis: u64| Instant::from_micros(millis * 1_000);
        let mut registers = RegisterFile::new([0; 6], None);
        let mut watchdog = WatchdogModel::OFF;
        watchdog.heard(at(0));
        assert!(!watchdog.may_act(at(100_000)));
        watchdog.set(at(0), 20);
        assert!(!watchdog.may_act(at(199)) && watchdog.may_act(at(200)));
        assert!(watchdog.check(at(230), at(0), 0, &registers).is_ok());
        assert!(watchdog.check(at(231), at(0), 0, &registers).is_err());
        assert!(watchdog.check(at(231), at(201), 0, &registers).is_ok(), "the shell stalled");
        registers.set(FAULTS.address, fault::HOST_SILENT);
        assert!(
            watchdog.check(at(231), at(0), 0, &registers).is_ok() && watchdog.check_fault(&registers).is_ok()
        );
        watchdog.set(at(300), 20);
        assert!(watchdog.check_fault(&registers).is_err(), "cleared by the write");
    }
}
