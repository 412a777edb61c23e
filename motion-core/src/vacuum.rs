//! The control of the vacuum pump and its valve ([D20](protocol_core::decisions#d20)).

use protocol_core::time::{Duration, Instant};

/// How long the valve stays open to release. The maker's valve overheats if it stays open longer.
const RELEASE_TIME: Duration = Duration::from_millis(500);

/// The two outputs of the vacuum control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Vacuum {
    /// The pump runs, never while the valve is open.
    pub pump: bool,
    /// The valve is open: air enters and the cup releases.
    pub valve: bool,
}

/// The state of the vacuum control.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VacuumControl {
    wanted: Vacuum,
    /// The outputs that `poll` returned last.
    shown: Vacuum,
    close_valve_at: Instant,
}

impl Default for VacuumControl {
    fn default() -> Self {
        Self { wanted: Vacuum::default(), shown: Vacuum::default(), close_valve_at: Instant::FAR_FUTURE }
    }
}

impl VacuumControl {
    /// Executes a write of register 31: suck or release. A repeated release has no effect, so that a host cannot keep the valve
    /// open by repeating it.
    pub fn set(&mut self, now: Instant, suck: bool) {
        if suck {
            self.wanted = Vacuum { pump: true, valve: false };
            self.close_valve_at = Instant::FAR_FUTURE;
        } else if self.wanted.pump {
            self.wanted = Vacuum { pump: false, valve: true };
            self.close_valve_at = now + RELEASE_TIME;
        }
    }

    /// The new state of the outputs at `now`, if it has changed.
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

    /// When the valve closes; [`Instant::FAR_FUTURE`] if it is closed.
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
    const RELEASE: Option<Vacuum> = Some(Vacuum { pump: false, valve: true });
    const OFF: Option<Vacuum> = Some(Vacuum { pump: false, valve: false });

    #[test]
    fn d20_release_opens_the_valve_for_half_a_second() {
        let mut control = VacuumControl::default();
        assert_eq!(control.poll(at_ms(0)), None);
        control.set(at_ms(10), true);
        assert_eq!(control.poll(at_ms(10)), SUCK);
        assert_eq!(control.poll(at_ms(11)), None, "returned once");
        control.set(at_ms(100), false);
        assert_eq!(control.poll(at_ms(100)), RELEASE);
        assert_eq!(control.deadline(), at_ms(600));
        assert_eq!(control.poll(at_ms(599)), None);
        assert_eq!(control.poll(at_ms(600)), OFF);
        assert_eq!(control.deadline(), Instant::FAR_FUTURE);
    }

    #[test]
    fn d20_repeated_release_does_not_hold_the_valve() {
        let mut control = VacuumControl::default();
        control.set(at_ms(0), false);
        assert_eq!(control.poll(at_ms(0)), None, "the pump was off");
        control.set(at_ms(0), true);
        control.set(at_ms(100), false);
        control.set(at_ms(400), false);
        assert_eq!(control.poll(at_ms(400)), RELEASE);
        assert_eq!(control.poll(at_ms(600)), OFF);
    }

    #[test]
    fn d20_sucking_again_closes_the_valve_at_once() {
        let mut control = VacuumControl::default();
        control.set(at_ms(0), true);
        control.set(at_ms(10), false);
        assert_eq!(control.poll(at_ms(10)), RELEASE);
        control.set(at_ms(20), true);
        assert_eq!(control.poll(at_ms(20)), SUCK);
        assert_eq!(control.poll(at_ms(600)), None, "the release is cancelled");
    }
}
