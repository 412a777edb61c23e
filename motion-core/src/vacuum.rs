//! The vacuum gripper: when the pump runs and when the valve is open (D20).

use protocol_core::time::{Duration, Instant};

/// How long the valve is held open to let go. The maker's valve overheats when it is held longer.
const RELEASE_TIME: Duration = Duration::from_millis(500);

/// The two outputs of the vacuum gripper.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Vacuum {
    /// The pump runs.
    pub pump: bool,
    /// The valve is open: air comes in and the cup lets go.
    pub valve: bool,
}

/// Decides over the outputs as time goes by.
#[derive(Clone, Copy, Debug)]
pub struct Gripper {
    wanted: Vacuum,
    /// What the outputs were last told to be.
    shown: Vacuum,
    close_valve_at: Instant,
}

impl Default for Gripper {
    fn default() -> Self {
        Self { wanted: Vacuum::default(), shown: Vacuum::default(), close_valve_at: Instant::FAR_FUTURE }
    }
}

impl Gripper {
    /// Register 31 was written: suck or release. Releasing what is released already does nothing, so that
    /// a host which repeats itself cannot hold the valve open.
    pub fn set(&mut self, now: Instant, suck: bool) {
        if suck {
            self.wanted = Vacuum { pump: true, valve: false };
            self.close_valve_at = Instant::FAR_FUTURE;
        } else if self.wanted.pump {
            self.wanted = Vacuum { pump: false, valve: true };
            self.close_valve_at = now + RELEASE_TIME;
        }
    }

    /// What the outputs have to be switched to at `now`, if that is news.
    pub fn poll(&mut self, now: Instant) -> Option<Vacuum> {
        if self.close_valve_at <= now {
            self.wanted.valve = false;
            self.close_valve_at = Instant::FAR_FUTURE;
        }
        (self.wanted != self.shown).then(|| {
            self.shown = self.wanted;
            self.shown
        })
    }

    /// When the outputs change next by themselves.
    #[must_use]
    pub const fn deadline(&self) -> Instant {
        self.close_valve_at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    const SUCK: Option<Vacuum> = Some(Vacuum { pump: true, valve: false });
    const LET_GO: Option<Vacuum> = Some(Vacuum { pump: false, valve: true });
    const OFF: Option<Vacuum> = Some(Vacuum { pump: false, valve: false });

    #[test]
    fn d20_release_opens_the_valve_for_half_a_second() {
        let mut gripper = Gripper::default();
        assert_eq!(gripper.poll(at_ms(0)), None);
        gripper.set(at_ms(10), true);
        assert_eq!(gripper.poll(at_ms(10)), SUCK);
        assert_eq!(gripper.poll(at_ms(11)), None, "said once");
        gripper.set(at_ms(100), false);
        assert_eq!(gripper.poll(at_ms(100)), LET_GO);
        assert_eq!(gripper.deadline(), at_ms(600));
        assert_eq!(gripper.poll(at_ms(599)), None);
        assert_eq!(gripper.poll(at_ms(600)), OFF);
        assert_eq!(gripper.deadline(), Instant::FAR_FUTURE);
    }

    #[test]
    fn d20_repeated_release_does_not_hold_the_valve() {
        let mut gripper = Gripper::default();
        gripper.set(at_ms(0), false);
        assert_eq!(gripper.poll(at_ms(0)), None, "nothing was held");
        gripper.set(at_ms(0), true);
        gripper.set(at_ms(100), false);
        gripper.set(at_ms(400), false);
        assert_eq!(gripper.poll(at_ms(400)), LET_GO);
        assert_eq!(gripper.poll(at_ms(600)), OFF);
    }

    #[test]
    fn d20_sucking_again_closes_the_valve_at_once() {
        let mut gripper = Gripper::default();
        gripper.set(at_ms(0), true);
        gripper.set(at_ms(10), false);
        assert_eq!(gripper.poll(at_ms(10)), LET_GO);
        gripper.set(at_ms(20), true);
        assert_eq!(gripper.poll(at_ms(20)), SUCK);
        assert_eq!(gripper.poll(at_ms(600)), None, "the old release is forgotten");
    }
}
