//! Servos at rest: their steps change nothing but sums and counts, so that they are simulated all at once, when the rest ends.

use protocol_core::registers::Joint;
use protocol_core::time::Instant;

use super::Plant;
use crate::servo::Servo;
use crate::servo::units::STEP;

/// The steps of a servo that change nothing, as long as no call changes the servo.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Rest {
    /// The end of the step before the first one.
    since: Instant,
    /// The end of the last one.
    until: Instant,
    /// The supply voltage in these steps.
    decivolts: u8,
}

impl Rest {
    /// The next step may change something.
    pub(super) const NONE: Self = Self { since: Instant::ZERO, until: Instant::ZERO, decivolts: 0 };

    /// The rest of a servo after its step that ended at `now`.
    pub(super) fn after_step(servo: &Servo, now: Instant, decivolts: u8) -> Self {
        Self { since: now, until: servo.rest_until(now, decivolts), decivolts }
    }

    /// The end of the last step with this supply voltage; in the past if there is none.
    pub(super) fn until(self, decivolts: u8) -> Instant {
        if decivolts == self.decivolts { self.until } else { Instant::ZERO }
    }

    /// Ends the rest: simulates its steps up to `now`.
    pub(super) fn end(&mut self, servo: &mut Servo, now: Instant) {
        let steps = (now.min(self.until) - self.since).as_micros() / STEP.as_micros();
        if steps > 0 {
            servo.rest(u32::try_from(steps).unwrap_or(u32::MAX));
        }
        *self = Self::NONE;
    }
}

impl Plant {
    /// Ends the rest of all servos.
    pub(super) fn wake(&mut self) {
        self.rest_until = self.now;
        for (servo, rest) in self.servos.iter_mut().zip(&mut self.rests) {
            rest.end(servo, self.now);
        }
    }

    /// A copy of a joint's servo that has counted its steps up to now.
    pub(super) fn counted(&self, joint: Joint) -> Option<Servo> {
        let index = usize::from(joint.index());
        let (mut servo, mut rest) = (self.servos.get(index)?.clone(), *self.rests.get(index)?);
        rest.end(&mut servo, self.now);
        Some(servo)
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::String;

    use protocol_core::request::Request;
    use protocol_core::time::Duration;

    use crate::faults::ArmFault;
    use crate::{Joint, Simulation};

    /// What an arm did that moves among faults, if its servos are woken every `period` milliseconds.
    fn run(period: u64) -> String {
        let mut arm = Simulation::default();
        let faults = ["2=wall=100", "7=push=20", "1=stuck", "4=restarting=700", "supply=dips=900"];
        for (index, fault) in (0_u16..).zip(faults) {
            arm.set_fault(fault.parse::<ArmFault>().unwrap(), None);
            arm.send_request(&Request::Write { address: 46, values: &[120, 95, 70] });
            for millis in 0..3_000 / u64::from(index + 1) {
                arm.advance(Duration::from_millis(1));
                if millis % period == 0 {
                    arm.plant_mut().wake();
                }
            }
        }
        let angles = Joint::ALL.map(|joint| arm.plant().angle(joint));
        alloc::format!("{angles:?} {:?} {:?}", arm.faults(), arm.registers())
    }

    #[test]
    fn a_rest_has_the_same_results_as_its_steps() {
        let together = run(u64::MAX);
        assert_eq!(together, run(1));
        assert_eq!(together, run(37));
    }
}
