//! The arm's side of the servo bus: what the servos say, and what they are told next.

use protocol_core::registers::map::{
    PRESENT_POSITION, SERVO_BUS_ERRORS, SPEED, SUPPLY_VOLTAGE, TARGET_POSITION,
};
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::time::{Duration, Instant};

use super::{Arm, JointState, TORQUE_REFRESH_CYCLES, offset};
use crate::CYCLE;
use crate::calibration::{angle_from_counts, counts_from_angle};
use crate::drive::Engaged;
use crate::servo_bus::{Outcome, Reading, Torque};

impl Arm {
    /// Takes in what the servos answered by `now`, and moves all set-points when a control cycle is due.
    pub(crate) fn advance(&mut self, now: Instant) {
        while let Some(outcome) = self.bus.poll(now) {
            match outcome {
                Outcome::Measured { joint, reading, alarms } => self.measured(now, joint, reading, alarms),
                Outcome::Failed { joint } => self.failed(now, joint),
            }
        }
        self.end_start_up(now);
        if now >= self.next_cycle {
            self.cycle(now);
        }
    }

    fn measured(&mut self, now: Instant, joint: Joint, reading: Reading, alarms: u8) {
        let offset = offset(&self.registers, joint);
        let starting = self.starting_until.is_some();
        let Some(state) = self.joints.get_mut(usize::from(joint.index())) else { return };
        let Some(counts) = state.sensor.answered(now, reading.position_counts) else { return };
        let angle = angle_from_counts(joint, counts, offset);
        state.alarms = alarms;
        state.temperature = reading.temperature_celsius;
        let may_engage = !starting && state.sensor.is_steady();
        let engaged = if may_engage { state.drive.engage(angle) } else { None };
        self.registers.set(PRESENT_POSITION.of(joint), angle.nearest_degree());
        if engaged == Some(Engaged::Holding) {
            self.registers.set(TARGET_POSITION.of(joint), angle.nearest_degree());
        }
        self.goals_due |= engaged.is_some();
        self.torque_due |= engaged.is_some();
        self.registers.set(SUPPLY_VOLTAGE.address, reading.voltage_decivolts);
        self.show_servos();
    }

    fn failed(&mut self, now: Instant, joint: Joint) {
        if self.starting_until.is_none() {
            self.registers.increment(&SERVO_BUS_ERRORS);
        }
        let Some(state) = self.joints.get_mut(usize::from(joint.index())) else { return };
        if state.sensor.failed(now) {
            state.drive.lose();
            state.temperature = 0;
            state.alarms = 0;
            self.torque_due = true;
            self.show_servos();
        }
    }

    /// Start-up is over once every joint is measured, or once the rest was waited for long enough.
    fn end_start_up(&mut self, now: Instant) {
        let Some(deadline) = self.starting_until else { return };
        if now >= deadline || self.joints.iter().all(|joint| joint.sensor.is_known()) {
            self.starting_until = None;
            self.show_servos();
        }
    }

    fn cycle(&mut self, now: Instant) {
        // One cycle may be made up for; more than that, and motion is late rather than fast.
        self.next_cycle = self.next_cycle.max(earlier(now, CYCLE)) + CYCLE;
        self.left_to_ask = JOINTS;
        for (joint, state) in Joint::ALL.into_iter().zip(&mut self.joints) {
            if state.drive.is_engaged() {
                state.drive.advance(self.registers.get(SPEED.of(joint)));
                self.goals_due = true;
            }
        }
        self.show_moving();
        self.torque_refresh_in = self.torque_refresh_in.saturating_sub(1);
        self.torque_due |= self.torque_refresh_in == 0;
    }

    /// Prepares the next frame for the servo bus, if there is one and the bus is idle. Goals go before
    /// torque, so that no servo wakes up with an old goal.
    pub(crate) fn command_servos(&mut self, now: Instant) -> bool {
        if !self.bus.is_idle(now) {
            return false;
        }
        if core::mem::take(&mut self.goals_due) && self.send_goals(now) {
            return true;
        }
        self.send_torque(now) || self.ask(now)
    }

    fn send_goals(&mut self, now: Instant) -> bool {
        let Self { joints, registers, bus, .. } = self;
        let engaged = || Joint::ALL.into_iter().zip(&*joints).filter(|(_, state)| state.drive.is_engaged());
        let goal = |(joint, state): (Joint, &JointState)| {
            (joint, counts_from_angle(joint, state.drive.set_point(), offset(registers, joint)))
        };
        let any = engaged().next().is_some();
        if any {
            bus.set_goals(now, engaged().map(goal));
        }
        any
    }

    fn send_torque(&mut self, now: Instant) -> bool {
        if !core::mem::take(&mut self.torque_due) {
            return false;
        }
        let mut torque = [Torque::Free; JOINTS];
        for (torque, joint) in torque.iter_mut().zip(&self.joints) {
            *torque = self.mode.torque(joint.drive.is_engaged());
        }
        self.bus.set_torque(now, &torque);
        self.joints.iter_mut().for_each(|joint| joint.drive.torque_is_on());
        self.torque_refresh_in = TORQUE_REFRESH_CYCLES;
        true
    }

    /// Asks the next servo whose turn has not come in this cycle.
    fn ask(&mut self, now: Instant) -> bool {
        while self.left_to_ask > 0 {
            self.left_to_ask -= 1;
            let joint = self.next_to_ask;
            self.next_to_ask = Joint::from_index(joint.index() + 1).unwrap_or(Joint::ALL[0]);
            let state = self.joints.get(usize::from(joint.index()));
            if state.is_some_and(|state| state.sensor.wants_asking(now)) {
                self.bus.ask(now, joint);
                return true;
            }
        }
        false
    }

    /// When the arm has something to do by itself.
    pub(crate) fn deadline(&self, now: Instant) -> Instant {
        let bus = if self.bus.is_idle(now) { Instant::FAR_FUTURE } else { self.bus.busy_until() };
        self.next_cycle.min(bus).min(self.gripper.deadline()).min(self.feedback.due())
    }
}

fn earlier(now: Instant, by: Duration) -> Instant {
    Instant::from_micros(now.as_micros().saturating_sub(by.as_micros()))
}
