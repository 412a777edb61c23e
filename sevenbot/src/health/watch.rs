//! Decides from the registers of an arm whether the arm still carries out a move. Does no input or output, and reads no clock.
//!
//! ```text
//!   time ──▶ MoveWatch::question ──▶ the registers to ask for, or MoveFault::Silent
//!   registers ──▶ MoveWatch::registers ──▶ Ok, or MoveFault
//! ```
//!
//! [`MoveCheck`](super::MoveCheck) is the shell for a blocking program. The page in a browser reads all registers in rounds, and
//! passes them on. All times count from the same instant.

use std::time::Duration;

use protocol_core::registers::map::{
    EFFECTOR_TYPE, FAULTS, FRAMES_ACCEPTED, MOTOR_STATE, SERVO_ALARMS, SERVO_TEMPERATURE, SET_POINT_PERIOD,
    effector, fault, motor_state,
};

use super::{ALARM_BITS, ALL_JOINTS, Problem, ProblemFlags, ProblemKind};
use crate::status_block::has_restarted;
use host_link::sharing::SharingState;
use host_link::{Snapshot, Span};

/// The registers of a check: set-point period, protection block, status block.
pub(super) const REGISTERS: Span = Span::between(&SET_POINT_PERIOD, &SERVO_TEMPERATURE);
pub(super) const STATE_REGISTERS: Span = Span::between(&MOTOR_STATE, &EFFECTOR_TYPE);
/// The shortest time between two questions.
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// A new alarm ends the move after this time. Until then the arm may report a joint that let go, which explains the alarm.
const ALARM_GRACE: Duration = Duration::from_secs(3);
/// Questions and answers take at most 1/10 of the line's capacity.
const SHARE_OF_LINE: u32 = 10;
/// Bits of a question and its answer on the line: 7 bytes each, and the values of the answer. A byte has ten bits.
const BITS_PER_CHECK: u32 = 10 * (7 + 7 + REGISTERS.count() as u32);
/// Bits of the shortest frame on the line: seven bytes of ten bits.
const BITS_OF_FRAME: u128 = 70;
/// An arm is silent after this time without an answer, if [`UNANSWERED_QUESTIONS`] were sent meanwhile.
pub(super) const SILENCE: Duration = Duration::from_millis(1_500);
/// The smallest number of unanswered questions after which an arm is silent.
const UNANSWERED_QUESTIONS: u32 = 3;
/// A joint that was blocked before the move has this time to get free. In a stream the flag of a blocked joint goes only once
/// the joint is free (D27).
const TIME_TO_GET_FREE: Duration = Duration::from_secs(2);

/// Why an arm does not carry out a move.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MoveFault {
    /// These problems end the move. [`ProblemKind::remedy`] says what to do.
    Problems(Vec<Problem>),
    /// The motors do not drive the joints.
    NotDriven {
        /// The value of register 29.
        state: u8,
    },
    /// The arm has not answered for 1.5 s, nor to the last three questions.
    Silent,
    /// Another program stopped the arm through the server that both use, or ended this program's stream.
    StoppedByAnother,
}

/// Watches over the driven joints of one move.
///
/// ```
/// use sevenbot::health::{MoveFault, MoveWatch};
/// use sevenbot::{Snapshot, map};
/// use std::time::Duration;
///
/// let mut watch = MoveWatch::new(Duration::ZERO, 0b1, 115_200);
/// let mut registers = Snapshot { address: 0, values: vec![0; 256] };
/// registers.values[usize::from(map::MOTOR_STATE.address)] = map::motor_state::SERVO;
/// assert_eq!(watch.registers(Duration::from_millis(100), &registers), Ok(()));
/// registers.values[usize::from(map::MOTOR_STATE.address)] = map::motor_state::FORCELESS;
/// let fault = watch.registers(Duration::from_millis(200), &registers);
/// assert_eq!(fault, Err(MoveFault::NotDriven { state: 2 }));
/// ```
#[derive(Clone, Debug)]
pub struct MoveWatch {
    /// The watched joints, as [`Joint::bit`](crate::Joint::bit)s.
    joints: u8,
    /// Do the motors have to drive the joints? If not, it is enough that the positions are measured.
    needs_motors: bool,
    /// The joints that have been blocked since before the move.
    blocked_before: u8,
    /// The bits of register 241 for a restart, at the last answer.
    restarts_told: Option<u8>,
    /// The alarms at the first answer.
    alarms_before: Option<u8>,
    /// When alarms other than `alarms_before` came; `None` if there are none now.
    alarm_since: Option<Duration>,
    is_at_end: bool,
    /// Is the effector a gripper? Then an obstacle of joint 7 is a held object.
    is_gripper: bool,
    begun: Duration,
    baud: u32,
    /// The arm's counter of frames in the last answer that held it, and a time before the arm sent that answer. This program
    /// may have taken the answer much later.
    accepted: Option<(Duration, u16)>,
    /// The set-point period that the arm must have while a stream is open.
    period_ms: Option<u16>,
    last_answer: Duration,
    /// The time of the answer before the last one. The question for the last answer was sent later.
    answer_before: Duration,
    unanswered: u32,
    question_period: Duration,
    next_question: Duration,
    is_state_next: bool,
}

impl MoveWatch {
    /// Watches over these joints, as [`Joint::bit`](crate::Joint::bit)s, of an arm on a line with this baud rate.
    #[must_use]
    pub fn new(now: Duration, joints: u8, baud: u32) -> Self {
        let check = Duration::from_secs(1) * BITS_PER_CHECK / baud.max(1);
        let question_period = POLL_PERIOD.max(check * SHARE_OF_LINE);
        Self {
            joints,
            needs_motors: true,
            blocked_before: u8::MAX,
            restarts_told: None,
            alarms_before: None,
            alarm_since: None,
            is_at_end: false,
            is_gripper: true,
            begun: now,
            baud,
            accepted: None,
            period_ms: None,
            last_answer: now,
            answer_before: now,
            unanswered: 0,
            question_period,
            next_question: now + question_period,
            is_state_next: true,
        }
    }

    /// For a stream: the set-point period that the arm has from now on, in milliseconds. A different one ends the move.
    #[must_use]
    pub const fn with_period(mut self, milliseconds: u16) -> Self {
        self.period_ms = Some(milliseconds);
        self
    }

    /// For a recording of all joints: only silence or a problem that hides positions ends it, and the motors may be off.
    #[must_use]
    pub const fn of_positions(mut self) -> Self {
        self.joints = ALL_JOINTS;
        self.needs_motors = false;
        self
    }

    /// The watched joints, as [`Joint::bit`](crate::Joint::bit)s.
    #[must_use]
    pub const fn joints(&self) -> u8 {
        self.joints
    }

    /// Do these registers show that joint 7 is a gripper and holds something?
    pub(super) fn is_gripping(&self, registers: &Snapshot) -> bool {
        ProblemFlags::of(registers, self.is_gripper).is_gripping
    }

    /// Watches over these joints, too, from `now` on.
    pub const fn add_joints(&mut self, joints: u8, now: Duration) {
        if joints & !self.joints != 0 {
            self.joints |= joints;
            self.begun = now;
        }
    }

    /// From now on a new alarm is a problem at once, because no later check would see it.
    pub const fn end(&mut self) {
        self.is_at_end = true;
    }

    /// The registers to ask for now; `None` if no question is due. Counts the question as sent.
    ///
    /// # Errors
    /// [`MoveFault::Silent`] if no answer came for 1.5 s, to three questions or more.
    pub fn question(&mut self, now: Duration) -> Result<Option<Span>, MoveFault> {
        if self.unanswered >= UNANSWERED_QUESTIONS && now >= self.last_answer + SILENCE {
            return Err(MoveFault::Silent);
        }
        if now < self.next_question {
            return Ok(None);
        }
        self.next_question = now + self.question_period;
        self.unanswered = self.unanswered.saturating_add(1);
        let span = if self.is_state_next && self.needs_motors { STATE_REGISTERS } else { REGISTERS };
        self.is_state_next = !self.is_state_next;
        Ok(Some(span))
    }

    /// Takes registers that came at `now`: motor state and effector, those from 184 to 255, or both.
    ///
    /// # Errors
    /// The registers show that the arm does not carry out the move.
    pub fn registers(&mut self, now: Duration, registers: &Snapshot) -> Result<(), MoveFault> {
        (self.answer_before, self.last_answer, self.unanswered) = (self.last_answer, now, 0);
        let has_state = registers.holds(STATE_REGISTERS);
        if has_state {
            self.is_gripper = registers.byte(&EFFECTOR_TYPE) == effector::GRIPPER;
        }
        // Problems come before the motor state: a lost supply is the reason why the motors are off.
        if registers.holds(REGISTERS) {
            let problems = self.problems(registers, now);
            if !problems.is_empty() {
                return Err(MoveFault::Problems(problems));
            }
            if self.needs_motors && self.is_stopped_by_another(registers) {
                return Err(MoveFault::StoppedByAnother);
            }
        }
        let state = registers.byte(&MOTOR_STATE);
        if has_state && self.needs_motors && state != motor_state::SERVO {
            return Err(MoveFault::NotDriven { state });
        }
        Ok(())
    }

    fn problems(&mut self, registers: &Snapshot, now: Duration) -> Vec<Problem> {
        let mut flags = ProblemFlags::of(registers, self.is_gripper);
        self.blocked_before &= flags.blocked;
        if now < self.begun + TIME_TO_GET_FREE {
            flags.blocked &= !self.blocked_before;
        }
        let restarted = self.has_restarted(registers).then_some(Problem::of_arm(ProblemKind::Restarted));
        let all =
            restarted.into_iter().chain(flags.problems(self.joints)).chain(self.new_alarms(registers, now));
        all.filter(|problem| self.needs_motors || problem.kind.hides_positions()).collect()
    }

    /// The alarms that were not set at the first answer, after a grace time. A servo with an alarm may have switched itself off:
    /// within that time the arm reports a driven joint that let go, which says more.
    fn new_alarms(&mut self, registers: &Snapshot, now: Duration) -> impl Iterator<Item = Problem> + use<> {
        let alarms = if registers.has_protection_block() { registers.byte(&SERVO_ALARMS) } else { 0 };
        let new = alarms & !*self.alarms_before.get_or_insert(alarms);
        self.alarm_since = self.alarm_since.or(Some(now)).filter(|_| new != 0);
        let is_due = self.alarm_since.is_some_and(|since| self.is_at_end || now >= since + ALARM_GRACE);
        let due = if is_due { new } else { 0 };
        ALARM_BITS.into_iter().filter(move |(bit, _)| due & bit != 0).map(|(_, kind)| Problem::of_arm(kind))
    }

    /// Has the controller restarted since the last answer? A restart resets the counter of frames, switches the stream off,
    /// and may set a bit of register 241. Behind a server another program may switch the stream off, so there the period is
    /// no sign of a restart.
    fn has_restarted(&mut self, registers: &Snapshot) -> bool {
        if !registers.has_status_block() {
            return false;
        }
        let accepted = registers.counter(&FRAMES_ACCEPTED);
        let newest = (self.answer_before, accepted);
        let (since, before) = self.accepted.replace(newest).unwrap_or(newest);
        let is_shared = SharingState::of(registers).is_some();
        // The counter may hide a restart if it was near its wrap.
        let told = registers.byte(&FAULTS) & (fault::WATCHDOG_RESTART | fault::BROWN_OUT_RESTART);
        let told_before = self.restarts_told.replace(told).unwrap_or(told);
        (self.has_other_period(registers) && !is_shared)
            || told & !told_before != 0
            || has_restarted(before, accepted, self.frames_since(since))
    }

    /// The largest number of frames that the line can have carried between this time and the last answer.
    fn frames_since(&self, time: Duration) -> u32 {
        let bits = self.last_answer.saturating_sub(time).as_millis() * u128::from(self.baud) / 1_000;
        u32::try_from(bits / BITS_OF_FRAME).unwrap_or(u32::MAX)
    }

    /// Did another program stop the arm through the server? A stop switches the set-point period off a moment before the
    /// server reports the stop.
    fn is_stopped_by_another(&self, registers: &Snapshot) -> bool {
        SharingState::of(registers)
            .is_some_and(|server| server.is_stopped || self.has_other_period(registers))
    }

    fn has_other_period(&self, registers: &Snapshot) -> bool {
        self.period_ms.is_some_and(|period| registers.word(SET_POINT_PERIOD.address) != period)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_link::sharing::FIRST;
    use protocol_core::registers::map::{MISSING_SERVOS, PROTECTION_VERSION, STATUS_VERSION};

    const fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// All registers of a driven arm with a stream of 20 ms. It has accepted `frames` frames.
    fn registers(frames: u8) -> Snapshot {
        let mut all = Snapshot { address: 0, values: vec![0; 256] };
        let rows = [&STATUS_VERSION, &PROTECTION_VERSION, &MOTOR_STATE].map(|row| (row.address, 1));
        let values = [(FRAMES_ACCEPTED.address, frames), (SET_POINT_PERIOD.address, 20)];
        for (address, value) in rows.into_iter().chain(values) {
            all.values[usize::from(address)] = value;
        }
        all
    }

    #[test]
    fn questions_take_turns_and_an_arm_that_answers_none_is_silent() {
        let mut watch = MoveWatch::new(ms(0), 1, 115_200);
        let asked: Vec<_> =
            (1..=4).map(|number| watch.question(ms(100 * number)).expect("not silent yet")).collect();
        let [state, rest] = [STATE_REGISTERS, REGISTERS].map(Some);
        assert_eq!(asked, [state, rest, state, rest]);
        assert_eq!(watch.question(ms(410)), Ok(None), "not yet");
        assert!(watch.question(ms(1_499)).is_ok());
        assert_eq!(watch.question(ms(1_500)), Err(MoveFault::Silent));
        assert_eq!(watch.registers(ms(1_510), &registers(1)), Ok(()));
        assert!(watch.question(ms(3_000)).is_ok(), "only one question since");
    }

    #[test]
    fn a_restart_and_a_lost_period_end_a_stream() {
        let restarted = MoveFault::Problems(vec![Problem::of_arm(ProblemKind::Restarted)]);
        let mut watch = MoveWatch::new(ms(0), 1, 115_200).with_period(20);
        assert_eq!(watch.registers(ms(10), &registers(200)), Ok(()));
        assert_eq!(watch.registers(ms(20), &registers(3)), Err(restarted.clone()));
        let mut other_period = registers(4);
        other_period.values[usize::from(SET_POINT_PERIOD.address)] = 0;
        assert_eq!(watch.registers(ms(30), &other_period), Err(restarted));
    }

    #[test]
    fn a_stop_of_another_program_is_no_restart() {
        let stopped = Err(MoveFault::StoppedByAnother);
        let shared = |frames, flags, period| {
            let mut all = registers(frames);
            let server = Snapshot { address: FIRST, values: vec![1, 2, 0, 1, flags, 0, 0, 0] };
            all.put(&server);
            all.values[usize::from(SET_POINT_PERIOD.address)] = period;
            all
        };
        let watch = MoveWatch::new(ms(0), 1, 115_200).with_period(20);
        assert_eq!(watch.clone().registers(ms(10), &shared(1, 0, 20)), Ok(()));
        assert_eq!(watch.clone().registers(ms(10), &shared(1, 1, 20)), stopped);
        assert_eq!(watch.clone().registers(ms(10), &shared(1, 0, 0)), stopped, "the stop has just begun");
        let mut restarted = watch;
        assert_eq!(restarted.registers(ms(10), &shared(200, 0, 20)), Ok(()));
        assert!(matches!(restarted.registers(ms(20), &shared(3, 0, 0)), Err(MoveFault::Problems(_))));
        let mut move_of_joints = MoveWatch::new(ms(0), 1, 115_200);
        assert_eq!(move_of_joints.registers(ms(10), &shared(1, 1, 0)), stopped);
        let mut recording = MoveWatch::new(ms(0), 0, 115_200).of_positions();
        assert_eq!(recording.registers(ms(10), &shared(1, 1, 0)), Ok(()));
    }

    #[test]
    fn many_frames_between_two_answers_are_no_restart() {
        let frames = |count: u16| {
            let mut all = registers(0);
            all.values[usize::from(FRAMES_ACCEPTED.address)..][..2].copy_from_slice(&count.to_le_bytes());
            all
        };
        let mut watch = MoveWatch::new(ms(0), 1, 115_200);
        assert_eq!(watch.registers(ms(10), &frames(0)), Ok(()));
        assert_eq!(watch.registers(ms(60_000), &frames(33_000)), Ok(()), "the line can carry 98,000");
        // The answer taken at 60 s may have come earlier, so these 17,000 frames may have taken more than 0.1 s.
        assert_eq!(watch.registers(ms(60_100), &frames(50_000)), Ok(()));
        assert!(watch.registers(ms(60_200), &frames(50)).is_err(), "15,586 frames in 0.2 s");
        let mut wrapping = MoveWatch::new(ms(0), 1, 115_200);
        assert_eq!(wrapping.registers(ms(10), &frames(62_502)), Ok(()));
        let mut restarted = frames(3);
        restarted.values[usize::from(FAULTS.address)] = fault::WATCHDOG_RESTART;
        assert!(wrapping.registers(ms(110), &restarted).is_err(), "the arm tells of it");
        restarted.values[usize::from(FRAMES_ACCEPTED.address)] = 9;
        assert_eq!(wrapping.registers(ms(210), &restarted), Ok(()), "once");
    }

    #[test]
    fn a_silent_joint_ends_a_recording_and_motors_that_are_off_do_not() {
        let mut recorded = MoveWatch::new(ms(0), 0, 115_200).of_positions();
        let mut limp = registers(1);
        limp.values[usize::from(MOTOR_STATE.address)] = motor_state::FORCELESS;
        assert_eq!(recorded.registers(ms(10), &limp), Ok(()));
        limp.values[usize::from(MISSING_SERVOS.address)] = 0b100;
        let fault = recorded.registers(ms(20), &limp).expect_err("joint 3 is silent");
        let MoveFault::Problems(problems) = fault else { panic!("{fault:?}") };
        assert_eq!((problems.len(), problems[0].kind), (1, ProblemKind::NoAnswer));
        assert!(MoveWatch::new(ms(0), 0b1, 115_200).registers(ms(20), &limp).is_err(), "not driven");
    }
}
