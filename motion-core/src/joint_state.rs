//! One joint: its drive, its target, what its servo measured, and what protects it ([D12](protocol_core::decisions#d12),
//! [D21](protocol_core::decisions#d21), [D27](protocol_core::decisions#d27), [D28](protocol_core::decisions#d28)).
//!
//! ```text
//!   answers of the servo ──▶ this file ───▶ what protects the joint
//!                              └─▶ engaging.rs ──▶ first goal, torque
//!   targets of the host ──────▶ targets.rs ──────▶ set-point
//! ```
//!
//! This file does not know the other joints.

mod engaging;
mod measured;
mod targets;

use protocol_core::registers::map::{
    EFFECTOR_TYPE, FINE_POSITION, FINE_TARGET, GRIP_LIMIT, LOAD, PRESENT_POSITION, PROTECTION, PUSH_LIMIT,
    TARGET_POSITION, VELOCITY, effector,
};
use protocol_core::registers::map21::{PRESENT_ANGLE, PRESENT_LOAD};
use protocol_core::registers::{Joint, Register, RegisterFile};
use protocol_core::time::Instant;

use crate::calibration::{
    MicroDegrees, angle_from_counts, load_from_servo, push_from_servo, velocity_from_servo,
};
use crate::drive::Drive;
use crate::goal_check::GoalCheck;
use crate::let_go::LetGo;
use crate::obstacle::ObstacleWatch;
use crate::position_filter::{FilterOutcome, PositionFilter};
use crate::push_limiter::{FULL_LOAD, PushLimit, PushSample};
use crate::servo_bus::{Answer, Reading, Torque};
use crate::torque_check::{TorqueCheck, TorqueFound};
pub(crate) use measured::Measured;

/// The result of the checks of a joint that has a set-point.
enum Protected {
    Holds,
    Freed,
    TorqueLost,
    TurnedPast,
}

#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct JointState {
    joint: Joint,
    pub(crate) drive: Drive,
    pub(crate) position: PositionFilter,
    /// The target. Registers show it in degrees and in hundredths of a degree.
    target: MicroDegrees,
    /// Where the joint was last measured; `None` until its first measurement.
    measured: Option<MicroDegrees>,
    /// The velocity that the servo measured, in counts per second.
    servo_velocity: i16,
    /// The load, in 0.1 % of the stall torque, positive towards greater angles.
    load: i16,
    obstacle: ObstacleWatch,
    let_go: LetGo,
    torque: TorqueCheck,
    goal: GoalCheck,
    /// Since the controller started, the joint has not engaged, and the motor state has not changed. Its servo may still hold
    /// a goal from before.
    is_first_engagement: bool,
    /// The last question to the servo was not answered.
    pub(crate) is_unanswered: bool,
    /// The error bits of the servo's last accepted answer; 0 while it is silent.
    pub(crate) alarms: u8,
    /// The temperature of the servo, in degrees Celsius; 0 while unknown.
    pub(crate) temperature: u8,
}

impl JointState {
    /// A joint at power-up.
    pub(crate) const fn new(joint: Joint, drive: Drive) -> Self {
        Self {
            joint,
            drive,
            position: PositionFilter::UNKNOWN,
            target: MicroDegrees::from_degrees(TARGET_POSITION.default_at(TARGET_POSITION.of(joint))),
            measured: None,
            servo_velocity: 0,
            load: 0,
            obstacle: ObstacleWatch::NONE,
            let_go: LetGo::NO,
            torque: TorqueCheck::ORDERED,
            goal: GoalCheck::NEW,
            is_first_engagement: true,
            is_unanswered: false,
            alarms: 0,
            temperature: 0,
        }
    }

    /// The target that the registers show.
    pub(crate) const fn target(&self) -> MicroDegrees {
        self.target
    }

    /// Where the joint was last measured; `None` while its servo is silent.
    pub(crate) fn known_angle(&self) -> Option<MicroDegrees> {
        self.measured.filter(|_| self.position.is_known())
    }

    /// Was the joint measured since power-up?
    pub(crate) const fn was_measured(&self) -> bool {
        self.measured.is_some()
    }

    /// Processes an answer. If `may_engage`, a waiting or silent joint at rest may engage.
    pub(crate) fn read(
        &mut self,
        now: Instant,
        answer: &Answer,
        may_engage: bool,
        registers: &mut RegisterFile,
    ) -> Measured {
        self.is_unanswered = false;
        let was_known = self.position.is_known();
        let reading = &answer.reading;
        let counts = match self.position.answered(now, answer.answer_micros, reading.position_counts) {
            FilterOutcome::Accepted(counts) => counts,
            FilterOutcome::Rejected => return Measured::Rejected,
            FilterOutcome::FellSilent => {
                self.fall_silent();
                return Measured::FellSilent;
            }
        };
        let angle = angle_from_counts(self.joint, counts, registers.offset(self.joint));
        self.measured = Some(angle);
        self.servo_velocity = reading.speed;
        self.load = load_from_servo(self.joint, reading.load);
        let servo = (answer.alarms, reading.temperature_celsius);
        let is_unchanged = was_known && servo == (self.alarms, self.temperature);
        (self.alarms, self.temperature) = servo;
        registers.set(PRESENT_POSITION.of(self.joint), angle.nearest_degree());
        registers.set(PRESENT_ANGLE.of(self.joint), angle.nearest_degree());
        registers.set(PRESENT_LOAD.of(self.joint), shown_load(self.load));
        let accepted = if is_unchanged { Measured::Accepted } else { Measured::ServoChanged };
        if self.drive.is_torque_pending() {
            let due = self.check_goal(now, answer, may_engage, registers);
            return due.map_or(accepted, |goals| Measured::TorqueDue { goals });
        }
        if self.drive.has_set_point() {
            match self.protect(now, answer, angle, registers) {
                Protected::Holds => {}
                Protected::Freed => return Measured::Freed,
                Protected::TorqueLost => return Measured::TorqueLost,
                Protected::TurnedPast => return Measured::TurnedPast,
            }
        } else if self.let_go.is_let_go() {
            self.follow(now, answer, angle, registers);
        }
        if may_engage
            && !self.drive.is_driven()
            && self.position.is_steady()
            && self.engages(now, self.place(answer, angle, registers), registers)
        {
            return Measured::Engaged;
        }
        accepted
    }

    /// Checks the torque and the push of a joint that is engaged or silent.
    fn protect(
        &mut self,
        now: Instant,
        answer: &Answer,
        angle: MicroDegrees,
        registers: &RegisterFile,
    ) -> Protected {
        let set_point = self.drive.set_point();
        match self.torque.answered(answer.torque.map(|held| held.is_on)) {
            TorqueFound::AsBefore => {}
            TorqueFound::OrderLost => {
                self.drive.lose_torque(true);
                return Protected::Holds;
            }
            TorqueFound::Lost => return Protected::TorqueLost,
        }
        if self.let_go.is_freed(now, answer, angle, set_point) {
            self.lose_torque(now);
            self.let_go.follow(now, answer);
            return Protected::Freed;
        }
        let Reading { load, speed, .. } = answer.reading;
        let is_believed = self.drive.is_engaged() && !self.position.is_doubtful(speed);
        if is_believed && registers.get(PROTECTION.address) != 0 {
            let push = push_from_servo(self.joint, load, speed);
            let sample = PushSample { angle, push, is_saturated: load.saturating_abs() >= FULL_LOAD };
            if self.obstacle.measured(now, sample, set_point, self.push_limit(registers)) {
                return Protected::TurnedPast;
            }
        }
        Protected::Holds
    }

    /// How hard the joint may push ([D27](protocol_core::decisions#d27)).
    fn push_limit(&self, registers: &RegisterFile) -> PushLimit {
        let permille = |row: &Register| i16::from(registers.get(row.address)) * 10;
        if self.joint == Joint::ALL[6] && registers.get(EFFECTOR_TYPE.address) == effector::GRIPPER {
            PushLimit::Grip(permille(&GRIP_LIMIT))
        } else {
            PushLimit::Arm(permille(&PUSH_LIMIT))
        }
    }

    /// Lets the target of a joint that is let go follow its position, unless the host wrote a target or the protection is off.
    fn follow(&mut self, now: Instant, answer: &Answer, angle: MicroDegrees, registers: &mut RegisterFile) {
        self.let_go.follow(now, answer);
        if registers.get(PROTECTION.address) != 0 && !self.drive.is_moving() {
            self.set_target(angle, registers);
        }
    }

    /// Records that the servo holds no torque: the joint is let go ([D28](protocol_core::decisions#d28)).
    pub(crate) fn lose_torque(&mut self, now: Instant) {
        self.drive.lose_torque(false);
        self.obstacle.forget();
        self.let_go.let_go(now);
    }

    /// Records that the servo did not answer. Returns whether the servo counts as silent from now on.
    pub(crate) fn failed(&mut self, now: Instant) -> bool {
        self.is_unanswered = true;
        if self.drive.has_set_point() {
            self.torque.unanswered();
        }
        let fell_silent = self.position.failed(now);
        if fell_silent {
            self.fall_silent();
        }
        fell_silent
    }

    /// Records that the servo may have restarted unnoticed. Its torque switch is read before the next goal is sent to it.
    pub(crate) const fn doubt_torque(&mut self) {
        self.torque.doubt();
    }

    /// Does the joint wait to engage, although its servo answered the last question?
    pub(crate) fn waits_and_answers(&self) -> bool {
        self.drive.is_waiting() && self.position.is_known() && !self.is_unanswered
    }

    /// Is the joint driven, and is it certain that its servo has not restarted? Only such a joint is sent goals
    /// ([D29](protocol_core::decisions#d29)).
    pub(crate) fn takes_goals(&self) -> bool {
        self.drive.is_driven() && self.torque.is_trusted()
    }

    /// Is the joint sent a goal at `now`? A joint without torque gets one only while its measured position is fresh:
    /// some servos take a goal as an order to switch torque on.
    #[inline]
    pub(crate) fn takes_goal_at(&self, now: Instant) -> bool {
        self.takes_goals() && (self.drive.is_engaged() || self.position.is_fresh(now))
    }

    /// Does the next question have to ask for the torque switch? `is_refresh_near` tells that torque is refreshed soon.
    /// A waiting joint is always asked: it may have been silent, and its goal follows the answer at once
    /// ([D29](protocol_core::decisions#d29)).
    pub(crate) fn wants_torque_read(&self, is_refresh_near: bool) -> bool {
        self.drive.is_waiting()
            || (self.drive.has_set_point()
                && (self.torque.is_urgent() || (is_refresh_near && !self.torque.is_fresh())))
    }

    /// The torque for the servo in motor state 1; `None` leaves its switch unchanged. A joint whose torque was pending is
    /// engaged from now on if its goal check is done. Torque is refreshed only if a read has shown it on since the last
    /// refresh, so that a servo that let go is not switched on.
    pub(crate) fn take_torque(&mut self, is_protected: bool) -> Option<Torque> {
        let is_on = if self.drive.is_torque_pending() {
            self.goal.is_done()
        } else {
            self.takes_goals() && self.torque.is_fresh()
        };
        if is_on {
            self.drive.torque_is_on();
            self.is_first_engagement = false;
        }
        self.torque.refreshed();
        if self.position.is_known() && self.let_go.needs_torque_off(is_protected) {
            self.let_go.torque_off_is_sent();
            Some(Torque::Damping)
        } else {
            is_on.then_some(Torque::On)
        }
    }

    fn fall_silent(&mut self) {
        self.drive.mark_silent();
        self.obstacle.release();
        self.temperature = 0;
        self.alarms = 0;
    }

    /// Lets the joint wait to engage, for motor state 1, or releases it, for the others. Forgets the obstacle, and that the joint
    /// was let go.
    pub(crate) fn set_driven(&mut self, is_driven: bool) {
        self.obstacle.forget();
        self.let_go = LetGo::NO;
        self.is_first_engagement = false;
        if is_driven { self.drive.wait() } else { self.drive.release() }
    }

    /// Records that the host wrote the motor state: a joint that is let go may engage again
    /// ([D28](protocol_core::decisions#d28)).
    pub(crate) const fn order(&mut self) {
        self.let_go.ordered();
    }

    /// Forgets an obstacle, because the protection is switched off ([D27](protocol_core::decisions#d27)).
    pub(crate) fn forget_obstacle(&mut self) {
        self.obstacle.forget();
    }

    /// The angles of the joint have changed without a move: its set-point is not held back any more
    /// ([D27](protocol_core::decisions#d27)).
    pub(crate) fn release_set_point(&mut self) {
        self.obstacle.release();
    }

    /// Does an obstacle hold back the set-point, and did the last step, from `before`, bring it nearer to the measured
    /// position ([D27](protocol_core::decisions#d27))?
    pub(crate) fn gives_way_from(&self, before: MicroDegrees) -> bool {
        let distance = |angle: MicroDegrees| self.measured.map(|at| at.0.abs_diff(angle.0));
        self.obstacle.is_holding_back() && distance(self.drive.set_point()) < distance(before)
    }

    /// Is the joint blocked ([D27](protocol_core::decisions#d27))?
    pub(crate) const fn is_blocked(&self) -> bool {
        self.obstacle.is_blocked()
    }

    /// Is the joint let go ([D28](protocol_core::decisions#d28))?
    pub(crate) const fn is_let_go(&self) -> bool {
        self.let_go.is_let_go()
    }

    /// Shows target, position, velocity and load in the extended block ([D21](protocol_core::decisions#d21)).
    pub(crate) fn show_extended(&self, registers: &mut RegisterFile) {
        let position = self.measured.map_or(u16::MAX, MicroDegrees::nearest_centidegree);
        let velocity = velocity_from_servo(self.joint, self.servo_velocity);
        for (row, word) in [
            (FINE_TARGET, self.target.nearest_centidegree()),
            (FINE_POSITION, position),
            (VELOCITY, velocity.cast_unsigned()),
            (LOAD, self.load.cast_unsigned()),
        ] {
            registers.set_word(row.of(self.joint), word);
        }
    }
}

/// The register value of a load in 0.1 %: 128 + load / 8, 3 to 253 ([M9](protocol_core::decisions#m9)).
fn shown_load(load: i16) -> u8 {
    let steps = (load / 8).clamp(-125, 125);
    u8::try_from(128 + steps).unwrap_or(128)
}
