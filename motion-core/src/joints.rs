//! The seven joints: their measured positions, their drives, and the goals and torque of their servos (D9, D12, D13).
//!
//! ```text
//!   targets, offsets, state ──▶ ┌──────────────────────────┐ ──▶ goals, torque
//!   readings, silence       ──▶ │ 7 × PositionFilter, Drive│ ──▶ positions, alarms
//!                               └──────────────────────────┘
//! ```
//!
//! This file does not know the frames or the timing of the bus.

use protocol_core::registers::map::{PRESENT_POSITION, SPEED, TARGET_POSITION, TIME};
use protocol_core::registers::map21::{PRESENT_ANGLE, PRESENT_LOAD};
use protocol_core::registers::{Accepted, JOINTS, Joint, RegisterFile};
use protocol_core::time::Instant;

use crate::calibration::{MicroDegrees, angle_from_counts, counts_from_angle, load_from_servo};
use crate::drive::{Drive, Target};
use crate::motor_state::MotorState;
use crate::position_filter::{FilterOutcome, PositionFilter};
use crate::reach::Targets;
use crate::servo_bus::{Reading, Torque};

/// The state of one joint.
#[derive(Clone, Copy, Debug)]
struct JointState {
    drive: Drive,
    /// The target, of which the register shows the nearest degree.
    target: MicroDegrees,
    position: PositionFilter,
    /// The error bits of the servo's last answer.
    alarms: u8,
    /// In degrees Celsius; 0 while unknown.
    temperature: u8,
}

/// The effect of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measured {
    /// The position filter rejected the reading.
    Rejected,
    /// The filter rejected the reading, and the servo counts as silent from now on.
    FellSilent,
    /// The filter accepted the reading.
    Accepted,
    /// The filter accepted the reading, and the joint engaged: it needs its goal, then torque.
    Engaged,
}

/// The seven joints and their motor state.
#[derive(Debug)]
pub(crate) struct Joints {
    joints: [JointState; JOINTS],
    state: MotorState,
}

impl Joints {
    /// Joints at power-up. In the servo state each will engage at its measured position.
    pub(crate) fn new(state: MotorState) -> Self {
        let mut drive = Drive::RELEASED;
        if state == MotorState::Servo {
            drive.wait();
        }
        let joints = Joint::ALL.map(|joint| JointState {
            drive,
            target: MicroDegrees::from_degrees(TARGET_POSITION.default_at(TARGET_POSITION.of(joint))),
            position: PositionFilter::UNKNOWN,
            alarms: 0,
            temperature: 0,
        });
        Self { joints, state }
    }

    fn joint(&self, joint: Joint) -> Option<&JointState> {
        self.joints.get(usize::from(joint.index()))
    }

    fn joint_mut(&mut self, joint: Joint) -> Option<&mut JointState> {
        self.joints.get_mut(usize::from(joint.index()))
    }

    fn each(&self) -> impl Iterator<Item = (Joint, &JointState)> {
        Joint::ALL.into_iter().zip(&self.joints)
    }

    fn each_mut(&mut self) -> impl Iterator<Item = (Joint, &mut JointState)> {
        Joint::ALL.into_iter().zip(&mut self.joints)
    }

    fn set_of(&self, belongs: impl Fn(&JointState) -> bool) -> u8 {
        self.each().filter(|(_, state)| belongs(state)).fold(0, |bits, (joint, _)| bits | joint.bit())
    }

    /// Enters a motor state. The servo state takes the measured positions as targets (D13). Returns whether the state
    /// changed.
    pub(crate) fn set_state(&mut self, state: MotorState, registers: &mut RegisterFile) -> bool {
        if state == self.state {
            return false;
        }
        self.state = state;
        for (joint, joint_state) in self.each_mut() {
            if state != MotorState::Servo {
                joint_state.drive.release();
                continue;
            }
            joint_state.drive.wait();
            if joint_state.position.is_known() {
                joint_state.show_target(joint, registers.get(PRESENT_POSITION.of(joint)), registers);
            }
        }
        true
    }

    /// Starts the moves to the targets in a write that was applied.
    pub(crate) fn set_targets(&mut self, accepted: &Accepted<'_>, registers: &RegisterFile) {
        for (joint, state) in self.each_mut() {
            if let Some(degrees) = accepted.value_at(TARGET_POSITION.of(joint)) {
                state.target = MicroDegrees::from_degrees(degrees);
                state.drive.set_target(state.target, registers.get(TIME.of(joint)));
            }
        }
    }

    /// Starts the moves to the positions in a write that was applied (M7).
    pub(crate) fn reach(&mut self, targets: &Targets, registers: &mut RegisterFile) {
        for ((joint, state), target) in self.each_mut().zip(targets) {
            if let Some(angle) = *target {
                registers.set(TARGET_POSITION.of(joint), angle.nearest_degree());
                state.target = angle;
                state.drive.set_target(angle, registers.get(TIME.of(joint)));
            }
        }
    }

    /// Re-expresses the set-points under the new offsets (D9): a changed offset changes the angle of a joint that did
    /// not move. From there the joint moves to its target at its speed.
    pub(crate) fn rebase_offsets(&mut self, before: &[i8; JOINTS], registers: &RegisterFile) {
        for ((joint, state), &before) in self.each_mut().zip(before) {
            let offset = registers.offset(joint);
            if offset != before {
                let counts = counts_from_angle(joint, state.drive.set_point(), before);
                let set_point = angle_from_counts(joint, counts, offset);
                state.drive.rebase_offset(set_point, state.target, registers.get(TIME.of(joint)));
            }
        }
    }

    /// Processes a reading. If `may_engage`, a waiting joint at rest engages.
    pub(crate) fn measured(
        &mut self,
        now: Instant,
        joint: Joint,
        (reading, alarms): (Reading, u8),
        may_engage: bool,
        registers: &mut RegisterFile,
    ) -> Measured {
        let offset = registers.offset(joint);
        let Some(state) = self.joint_mut(joint) else { return Measured::Rejected };
        let counts = match state.position.answered(now, reading.position_counts) {
            FilterOutcome::Accepted(counts) => counts,
            FilterOutcome::Rejected => return Measured::Rejected,
            FilterOutcome::FellSilent => {
                state.fall_silent();
                return Measured::FellSilent;
            }
        };
        let angle = angle_from_counts(joint, counts, offset);
        state.alarms = alarms;
        state.temperature = reading.temperature_celsius;
        registers.set(PRESENT_POSITION.of(joint), angle.nearest_degree());
        registers.set(PRESENT_ANGLE.of(joint), angle.nearest_degree());
        registers.set(PRESENT_LOAD.of(joint), shown_load(load_from_servo(joint, reading.load)));
        let may_engage = may_engage && state.position.is_steady();
        let Some(target) = (if may_engage { state.drive.engage(angle) } else { None }) else {
            return Measured::Accepted;
        };
        if target == Target::Measured {
            state.show_target(joint, angle.nearest_degree(), registers);
        }
        Measured::Engaged
    }

    /// Records that a servo did not answer. Returns whether it counts as silent from now on.
    pub(crate) fn failed(&mut self, now: Instant, joint: Joint) -> bool {
        let Some(state) = self.joint_mut(joint) else { return false };
        let fell_silent = state.position.failed(now);
        if fell_silent {
            state.fall_silent();
        }
        fell_silent
    }

    /// Lets joints whose torque is pending wait again if their measurement is too old. After a late call they may no
    /// longer be where they were measured.
    pub(crate) fn expire_pending(&mut self, now: Instant) {
        for (_, state) in self.each_mut() {
            if state.drive.is_torque_pending() && !state.position.is_fresh(now) {
                state.drive.mark_silent();
            }
        }
    }

    /// Advances all set-points by one control cycle. Returns whether any joint is driven.
    pub(crate) fn advance(&mut self, registers: &RegisterFile) -> bool {
        let mut any = false;
        for (joint, state) in self.each_mut() {
            if state.drive.is_driven() {
                state.drive.advance(registers.get(SPEED.of(joint)));
                any = true;
            }
        }
        any
    }

    /// The goals of the driven joints, in servo counts.
    pub(crate) fn goals(&self, registers: &RegisterFile) -> impl Iterator<Item = (Joint, u16)> {
        self.each().filter(|(_, state)| state.drive.is_driven()).map(|(joint, state)| {
            (joint, counts_from_angle(joint, state.drive.set_point(), registers.offset(joint)))
        })
    }

    /// The torque for each servo; `None` leaves the switch unchanged. The caller has to send all of them: from now on
    /// joints whose torque was pending may move.
    pub(crate) fn take_torque(&mut self) -> [Option<Torque>; JOINTS] {
        let mut switches = [None; JOINTS];
        for (switch, joint) in switches.iter_mut().zip(&mut self.joints) {
            *switch = self.state.torque(joint.drive.is_driven());
            joint.drive.torque_is_on();
        }
        switches
    }

    /// Is the joint's servo to be read at `now`?
    pub(crate) fn wants_asking(&self, joint: Joint, now: Instant) -> bool {
        self.joint(joint).is_some_and(|state| state.position.wants_asking(now))
    }

    /// The joints whose servos do not answer, bit n-1 for joint n.
    pub(crate) fn silent(&self) -> u8 {
        self.set_of(|state| !state.position.is_known())
    }

    /// The joints whose set-point has not reached its target, bit n-1 for joint n.
    pub(crate) fn moving(&self) -> u8 {
        self.set_of(|state| state.drive.is_moving())
    }

    /// Does any servo report an error?
    pub(crate) fn any_alarm(&self) -> bool {
        self.joints.iter().any(|state| state.alarms != 0)
    }

    /// The highest temperature of a servo, in degrees Celsius; 0 while unknown.
    pub(crate) fn hottest(&self) -> u8 {
        self.joints.iter().map(|state| state.temperature).max().unwrap_or(0)
    }
}

impl JointState {
    /// Makes a measured position the target.
    fn show_target(&mut self, joint: Joint, degrees: u8, registers: &mut RegisterFile) {
        self.target = MicroDegrees::from_degrees(degrees);
        registers.set(TARGET_POSITION.of(joint), degrees);
    }

    fn fall_silent(&mut self) {
        self.drive.mark_silent();
        self.temperature = 0;
        self.alarms = 0;
    }
}

/// The register value of a load in 0.1 %: 128 + load / 8, 3 to 253 (M9).
fn shown_load(load: i16) -> u8 {
    let steps = (load / 8).clamp(-125, 125);
    u8::try_from(128 + steps).unwrap_or(128)
}

#[cfg(test)]
mod tests {
    use super::*;

    const J1: Joint = Joint::ALL[0];

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn reading(position_counts: u16) -> (Reading, u8) {
        (Reading { position_counts, speed: 0, load: 0, voltage_decivolts: 74, temperature_celsius: 31 }, 4)
    }

    /// Joints of which joint 1 was measured twice at 90 degrees.
    fn measured(state: MotorState) -> (Joints, RegisterFile) {
        let mut registers = RegisterFile::new([0; 6], None);
        let mut joints = Joints::new(state);
        joints.measured(at_ms(0), J1, reading(511), true, &mut registers);
        joints.measured(at_ms(10), J1, reading(511), true, &mut registers);
        (joints, registers)
    }

    #[test]
    fn d12_a_joint_engages_at_the_second_reading_and_the_others_are_left_as_they_are() {
        let (mut joints, registers) = measured(MotorState::Servo);
        assert_eq!((registers.get(PRESENT_POSITION.of(J1)), registers.get(TARGET_POSITION.of(J1))), (90, 90));
        assert_eq!(joints.goals(&registers).collect::<Vec<_>>(), [(J1, 511)]);
        let torque = joints.take_torque();
        assert_eq!((torque[0], &torque[1..]), (Some(Torque::On), [None; 6].as_slice()));
        assert_eq!((joints.silent(), joints.hottest(), joints.any_alarm()), (0b111_1110, 31, true));
    }

    #[test]
    fn d12_a_silent_joint_is_told_nothing() {
        let (mut joints, registers) = measured(MotorState::Servo);
        joints.take_torque();
        assert_eq!([2, 3, 4].map(|cycle| joints.failed(at_ms(cycle * 10), J1)), [false, false, true]);
        assert_eq!(joints.goals(&registers).count(), 0);
        assert_eq!(joints.take_torque(), [None; JOINTS]);
        assert_eq!((joints.silent(), joints.hottest(), joints.any_alarm()), (0x7F, 0, false));
    }

    #[test]
    fn d12_a_joint_is_not_given_torque_where_it_was_measured_long_ago() {
        let (mut joints, registers) = measured(MotorState::Servo);
        joints.expire_pending(at_ms(30));
        assert_eq!(joints.goals(&registers).count(), 1);
        joints.expire_pending(at_ms(31));
        assert_eq!(joints.goals(&registers).count(), 0);
        assert_eq!(joints.take_torque(), [None; JOINTS]);
    }

    #[test]
    fn d13_the_other_states_set_every_switch_and_drive_nothing() {
        for (state, torque) in [(MotorState::Damping, Torque::Damping), (MotorState::Forceless, Torque::Free)]
        {
            let (mut joints, mut registers) = measured(MotorState::Servo);
            assert!(joints.set_state(state, &mut registers));
            assert!(!joints.set_state(state, &mut registers), "the state did not change");
            assert_eq!(joints.take_torque(), [Some(torque); JOINTS]);
            assert_eq!(joints.goals(&registers).count(), 0);
            assert!(!joints.advance(&registers));
        }
    }

    #[test]
    fn d13_entering_the_servo_state_makes_the_measured_positions_the_targets() {
        let (mut joints, mut registers) = measured(MotorState::Forceless);
        registers.set(TARGET_POSITION.of(J1), 10);
        joints.set_state(MotorState::Servo, &mut registers);
        assert_eq!(registers.get(TARGET_POSITION.of(J1)), 90);
        assert_eq!(registers.get(TARGET_POSITION.of(Joint::ALL[2])), 65, "this joint was not measured");
    }
}
