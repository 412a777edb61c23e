//! The seven joints: their measured positions, their drives, and the goals and torque of their servos (D9, D12, D13).
//!
//! ```text
//!   targets, offsets, state ──▶ ┌──────────────────────────┐ ──▶ goals, torque
//!   readings, silence       ──▶ │ 7 × PositionFilter, Drive│ ──▶ positions, alarms
//!                               └──────────────────────────┘
//! ```
//!
//! This file does not know the frames or the timing of the bus.

use protocol_core::registers::map::{
    FINE_TARGET, LIMITS, MEASURED_JOINTS, MOTOR_STATE, SET_POINT_PERIOD, SPEED, TARGET_POSITION, TIME, limit,
    motor_state,
};
use protocol_core::registers::{Accepted, JOINTS, Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use crate::calibration::{MicroDegrees, angle_from_counts, counts_from_angle};
use crate::drive::Drive;
use crate::joint_state::{JointState, Measured};
use crate::limit_check::LimitCheck;
use crate::limits::linkage_step;
use crate::motor_state::MotorState;
use crate::reach::Reached;
use crate::servo_bus::{Reading, Torque};

/// The seven joints and their motor state.
#[derive(Clone, Debug)]
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
        Self { joints: Joint::ALL.map(|joint| JointState::new(joint, drive.clone())), state }
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
        for joint in &mut self.joints {
            if state != MotorState::Servo {
                joint.drive.release();
                continue;
            }
            joint.drive.wait();
            if let Some(angle) = joint.known_angle() {
                joint.set_target(angle, registers);
            }
        }
        true
    }

    /// Starts the moves to the targets in a write that was applied, whose frame came at `now`.
    pub(crate) fn set_targets(
        &mut self,
        now: Instant,
        accepted: &Accepted<'_>,
        registers: &mut RegisterFile,
    ) {
        for (joint, state) in self.each_mut() {
            if let Some(degrees) = accepted.value_at(TARGET_POSITION.of(joint)) {
                state.move_to(degrees, registers.get(TIME.of(joint)));
            }
        }
        if accepted.has_words() {
            self.set_fine_targets(now, accepted, registers);
        }
    }

    fn set_fine_targets(&mut self, now: Instant, accepted: &Accepted<'_>, registers: &mut RegisterFile) {
        for (joint, state) in self.each_mut() {
            let Some(centidegrees) = accepted.word_at(FINE_TARGET.of(joint)) else { continue };
            let angle = MicroDegrees::from_centidegrees(centidegrees);
            state.set_target(angle, registers);
            match registers.word(SET_POINT_PERIOD.address) {
                0 => state.drive.set_target(angle, registers.get(TIME.of(joint))),
                millis => state.drive.stream_to(angle, now, Duration::from_millis(millis.into())),
            }
        }
    }

    /// Starts the moves to the positions in a write that was applied (M7).
    pub(crate) fn reach(&mut self, reached: &Reached, registers: &mut RegisterFile) {
        for ((joint, state), target) in self.each_mut().zip(reached.targets) {
            if let Some(angle) = target {
                state.set_target(angle, registers);
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
                state.drive.rebase_offset(set_point, state.target(), registers.get(TIME.of(joint)));
            }
        }
    }

    /// Processes a reading. If `may_engage`, a waiting joint at rest engages.
    pub(crate) fn measured(
        &mut self,
        now: Instant,
        joint: Joint,
        reading: (Reading, u8),
        may_engage: bool,
        registers: &mut RegisterFile,
    ) -> Measured {
        let Some(state) = self.joint_mut(joint) else { return Measured::Rejected };
        state.read(now, reading, may_engage, registers)
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

    /// Advances all set-points by the control cycle that ends at `end`. Returns whether any joint is driven.
    pub(crate) fn advance(&mut self, end: Instant, registers: &RegisterFile) -> bool {
        let keeps_linkage = registers.get(LIMITS.address) & limit::LINKAGE != 0;
        let before = if keeps_linkage { self.linkage_set_points() } else { None };
        let mut any = false;
        for (joint, state) in self.each_mut() {
            if state.drive.is_driven() {
                state.drive.advance(end, registers.get(SPEED.of(joint)));
                any = true;
            }
        }
        if let Some(before) = before {
            self.keep_linkage(before);
        }
        any
    }

    /// The set-points of joints 2 and 3, if both have one.
    fn linkage_set_points(&self) -> Option<[MicroDegrees; 2]> {
        let [_, two, three, ..] = &self.joints;
        let both = two.drive.has_set_point() && three.drive.has_set_point();
        both.then(|| [two.drive.set_point(), three.drive.set_point()])
    }

    /// Lets joints 2 and 3 wait for each other where their step would break the linkage (D25).
    fn keep_linkage(&mut self, before: [MicroDegrees; 2]) {
        let Some(after) = self.linkage_set_points() else { return };
        let allowed = linkage_step(before, after);
        let [_, two, three, ..] = &mut self.joints;
        for (joint, (after, allowed)) in [two, three].into_iter().zip(after.into_iter().zip(allowed)) {
            if allowed != after {
                joint.drive.hold_back(allowed);
            }
        }
    }

    /// The first register because of which a write is refused against a limit (D25).
    pub(crate) fn against_limit(&self, check: &LimitCheck<'_>) -> Option<u8> {
        let enters_servo = self.state != MotorState::Servo
            && check.accepted.value_at(MOTOR_STATE.address) == Some(motor_state::SERVO);
        let target = |state: &JointState| {
            let measured = if enters_servo { state.known_angle() } else { None };
            Some(measured.unwrap_or(state.target()))
        };
        let set_point = |state: &JointState| state.drive.has_set_point().then_some(state.drive.set_point());
        check.first_refused(&self.joints.each_ref().map(target), &self.joints.each_ref().map(set_point))
    }

    /// Holds every joint at its set-point (D24).
    pub(crate) fn hold(&mut self, registers: &mut RegisterFile) {
        for joint in &mut self.joints {
            joint.hold(registers);
        }
    }

    /// Shows the registers of the extended block that follow from the joints (D21).
    pub(crate) fn show_extended(&self, registers: &mut RegisterFile) {
        for joint in &self.joints {
            joint.show_extended(registers);
        }
        registers.set(MEASURED_JOINTS.address, self.set_of(JointState::was_measured));
    }

    /// How many joints are driven.
    pub(crate) fn driven(&self) -> usize {
        self.joints.iter().filter(|state| state.drive.is_driven()).count()
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

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::PRESENT_POSITION;

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
    fn a_reading_tells_whether_anything_changed_beside_position_velocity_and_load() {
        let (mut joints, mut registers) =
            (Joints::new(MotorState::Forceless), RegisterFile::new([0; 6], None));
        let mut measure = |millis, alarms, temperature_celsius| {
            let reading = Reading { temperature_celsius, ..reading(511).0 };
            joints.measured(at_ms(millis), J1, (reading, alarms), true, &mut registers)
        };
        assert_eq!(measure(0, 0, 0), Measured::Rejected, "nothing to compare it with");
        assert_eq!(measure(10, 0, 0), Measured::ServoChanged, "it answers, at 0 degrees Celsius");
        assert_eq!(measure(20, 0, 0), Measured::Accepted);
        assert_eq!(measure(30, 0, 1), Measured::ServoChanged);
        assert_eq!(measure(40, 4, 1), Measured::ServoChanged);
        assert_eq!(measure(50, 4, 1), Measured::Accepted);
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
            assert!(!joints.advance(at_ms(0), &registers));
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
