//! The steps of the plant: supply, servos, the weight of the arm in its pose, and the room.

use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use super::rest::Rest;
use super::{Plant, inertia, weight};
use crate::servo::Servo;
use crate::servo::units::STEP;

/// Of a longer pause between calls, only the last part of this length is simulated.
const LONGEST_CATCH_UP: Duration = Duration::from_millis(100_000);

impl Plant {
    /// Simulates the whole steps up to `now`.
    pub(super) fn catch_up(&mut self, now: Instant) {
        let oldest = now.as_micros().saturating_sub(LONGEST_CATCH_UP.as_micros());
        if self.now.as_micros() < oldest {
            self.wake();
            self.now = Instant::from_micros(oldest);
        }
        while self.now + STEP <= now {
            if self.now + STEP <= self.rest_until {
                self.pass(now.min(self.rest_until));
            } else {
                self.step();
            }
        }
    }

    fn step(&mut self) {
        let before = self.now;
        self.now = before + STEP;
        self.supply.step(self.now);
        let supply = self.supply_decivolts();
        let mut turned = [false; JOINTS];
        for ((servo, rest), turned) in self.servos.iter_mut().zip(&mut self.rests).zip(&mut turned) {
            if rest.until(supply) < self.now {
                rest.end(servo, before);
                *turned = servo.step(self.now, supply);
                if !*turned {
                    *rest = Rest::after_step(servo, self.now, supply);
                }
            }
        }
        if turned.contains(&true) {
            self.follow(turned);
        } else {
            let supply = self.supply_decivolts();
            let ends = self.rests.iter().map(|rest| rest.until(supply));
            self.rest_until = ends.min().unwrap_or(self.now).min(self.supply.steady_until(self.now));
        }
        self.follow_in_room();
    }

    /// Updates the arm after a step in which these joints turned.
    fn follow(&mut self, [_, shoulder, elbow, roll, pitch, _, claw]: [bool; JOINTS]) {
        if claw {
            self.follow_claw();
        }
        // Joints 1, 6 and 7 carry no weight, and change no inertia.
        if shoulder || elbow || roll || pitch {
            self.update_weight();
        } else {
            self.rest_until = self.now;
        }
    }

    /// Skips the whole steps up to `end`, which must not be after `self.rest_until`.
    fn pass(&mut self, end: Instant) {
        let steps = (end - self.now).as_micros() / STEP.as_micros();
        self.now = self.now + Duration::from_micros(STEP.as_micros() * steps);
    }

    /// Loads each servo with its share of the arm's weight and inertia in the present pose.
    pub(super) fn update_weight(&mut self) {
        self.rest_until = self.now;
        let load_g = self.load_grams();
        let has_turned = self.pose.turn_to(self.angles());
        if !has_turned && self.weighed_g == Some(load_g) {
            return;
        }
        self.weighed_g = Some(load_g);
        let (pose, load_g) = (self.pose, load_g.into());
        let (torques, inertias) = (weight::torques(pose, load_g), inertia::inertias(pose, load_g));
        let (arm, scales) = (torques.into_iter().zip(inertias), self.scales);
        let servos = self.servos.iter_mut().zip(&mut self.rests).zip(scales);
        for (((servo, rest), scale), (torque, inertia)) in servos.zip(arm) {
            let torque = scale.torque_towards_counts(torque);
            if servo.weight() != torque {
                rest.end(servo, self.now);
            }
            servo.set_arm(torque, inertia);
        }
    }

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

    /// The state and the faults of an arm after motion under faults, if the rest of its servos ends every `period` milliseconds.
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
