//! Checks during a move whether the arm still carries it out, and tells why it does not.
//!
//! ```text
//!   MoveCheck::begin ──▶ check, check, ... (waits for the answer)   ──▶ Ok, or MoveCheckError::Problems
//!                    └─▶ poll, poll, ...   (never waits: a stream)  ──▶ the same
//! ```
//!
//! A driven joint that is blocked, let go or silent ends the move, and so do a lost supply and a restart of the controller. The
//! firmware without status block tells nothing of this.

use std::time::{Duration, Instant};

use protocol_core::registers::map::{
    EFFECTOR_TYPE, FRAMES_ACCEPTED, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, SERVO_TEMPERATURE,
    SET_POINT_PERIOD, STATUS_VERSION, motor_state,
};

use super::problem::sentences;
use super::told::GRIPPER;
use super::{ALL_JOINTS, Problem, ProblemFlags, ProblemKind};
use crate::arm::Arm;
use crate::error::Error;
use crate::status_block::has_restarted;
use host_link::{Snapshot, Span};

/// The registers of a check: set-point period, protection block, status block.
const REGISTERS: Span = Span::between(&SET_POINT_PERIOD, &SERVO_TEMPERATURE);
/// Motor state and effector.
const STATE_REGISTERS: Span = Span::between(&MOTOR_STATE, &EFFECTOR_TYPE);
/// The shortest time between two questions of [`MoveCheck::poll`].
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// The answers to these questions take at most this part of the line.
const SHARE_OF_LINE: u32 = 10;
/// Bits of a question and its answer on the line: 7 bytes each around the values, ten bits a byte.
const BITS_PER_CHECK: u32 = 10 * (7 + 7 + REGISTERS.count() as u32);
/// An arm that answers none of the last questions of [`MoveCheck::poll`] for this time is gone.
const SILENCE: Duration = Duration::from_millis(1_500);
/// So many questions at least.
const UNANSWERED_QUESTIONS: u32 = 3;
/// A joint that was blocked before the move has this time to get free: a point of a stream clears the flag only then (D27).
const TIME_TO_GET_FREE: Duration = Duration::from_secs(2);

/// Why an arm does not carry out a move.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MoveCheckError {
    /// These problems end the move. Each tells what to do: [`ProblemKind::remedy`].
    #[error("{}", sentences(.0))]
    Problems(Vec<Problem>),
    /// The motors do not drive the joints.
    #[error("the arm's motors are in state {state}: they do not drive the joints")]
    NotDriven {
        /// The value of register 29.
        state: u8,
    },
    /// An exchange with the arm failed.
    #[error(transparent)]
    Exchange(#[from] Error),
}

/// Watches over the driven joints of one move.
///
/// ```
/// use sevenbot::Joint;
/// use sevenbot::health::MoveCheck;
/// use sevenbot::simulated::{self, SimulationConfig};
/// use std::time::Duration;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let (mut arm, simulation) = simulated::arm(SimulationConfig::default())?;
/// let base = Joint::ALL[0];
/// let mut check = MoveCheck::begin(&mut arm, base.bit())?;
/// check.check(&mut arm)?;
/// simulation.with(|simulation| simulation.plant_mut().set_fault(base, "missing".parse().ok()));
/// arm.sleep(Duration::from_secs(1));
/// assert!(check.check(&mut arm).is_err_and(|error| error.to_string().starts_with("joint 1 does not answer")));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct MoveCheck {
    /// The driven joints, as [`Joint::bit`](crate::Joint::bit)s.
    joints: u8,
    /// Do the motors have to drive the joints? If not, they have to be measured only.
    needs_motors: bool,
    /// Blocked since before the move.
    blocked_before: u8,
    /// Is the effector a gripper? Then an obstacle of joint 7 is what it holds.
    is_gripper: bool,
    begun: Instant,
    /// The arm's counter of frames at the last answer.
    accepted: Option<u16>,
    /// The period that the arm has to have while a stream is open.
    period_ms: Option<u16>,
    last_answer: Instant,
    unanswered: u32,
    next_question: Instant,
    is_state_next: bool,
}

/// What an arm does during a move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MoveState {
    /// The joints whose set-point moves; `None` if the firmware does not tell.
    pub moving: Option<u8>,
    /// The joints whose servo does not answer.
    pub missing: u8,
    /// Does joint 7, a gripper, hold something?
    pub is_gripping: bool,
}

impl MoveCheck {
    /// Begins to watch over these joints, as [`Joint::bit`](crate::Joint::bit)s.
    ///
    /// # Errors
    /// [`MoveCheckError::Problems`] if a joint cannot be driven now; one that is blocked can, because its next target tries again.
    /// [`MoveCheckError::NotDriven`] if the motors are off, and the errors of [`Arm::read`].
    pub fn begin(arm: &mut Arm, joints: u8) -> Result<Self, MoveCheckError> {
        let mut check = Self { joints, ..Self::idle(arm) };
        check.read(arm)?;
        Ok(check)
    }

    /// Watches over no joint yet, and asks nothing now.
    pub(crate) fn idle(arm: &mut Arm) -> Self {
        // The answer to a question of the move before is no news.
        arm.forget_background_question();
        let now = arm.now();
        Self {
            joints: 0,
            needs_motors: true,
            blocked_before: u8::MAX,
            is_gripper: true,
            begun: now,
            accepted: None,
            period_ms: None,
            last_answer: now,
            unanswered: 0,
            next_question: now + poll_period(arm),
            is_state_next: true,
        }
    }

    /// For a stream: from now on the arm has this set-point period, in milliseconds.
    #[must_use]
    pub const fn with_period(mut self, milliseconds: u16) -> Self {
        self.period_ms = Some(milliseconds);
        self
    }

    /// For a recording of all joints: only what makes the positions wrong ends it, and the motors may be off.
    pub(crate) const fn of_positions(mut self) -> Self {
        self.joints = ALL_JOINTS;
        self.needs_motors = false;
        self
    }

    /// The joints that it watches over, as [`Joint::bit`](crate::Joint::bit)s.
    #[must_use]
    pub const fn joints(&self) -> u8 {
        self.joints
    }

    /// Watches over these joints, too, from `now` on.
    pub const fn add_joints(&mut self, joints: u8, now: Instant) {
        if joints & !self.joints != 0 {
            self.joints |= joints;
            self.begun = now;
        }
    }

    /// Asks the arm, and waits for its answer.
    ///
    /// # Errors
    /// [`MoveCheckError::Problems`] and [`MoveCheckError::NotDriven`] end the move. Also the errors of [`Arm::read`].
    pub fn check(&mut self, arm: &mut Arm) -> Result<MoveState, MoveCheckError> {
        let registers = self.read(arm)?;
        Ok(registers.map_or_else(MoveState::default, |registers| MoveState {
            moving: Some(registers.byte(&MOVING_JOINTS)),
            missing: registers.byte(&MISSING_SERVOS),
            is_gripping: ProblemFlags::of(&registers, self.is_gripper).is_gripping,
        }))
    }

    /// Looks at the answers that have arrived, and asks again when it is time. Never waits.
    ///
    /// # Errors
    /// As [`Self::check`]. Also if the last questions, three or more in 1.5 s, were not answered.
    pub fn poll(&mut self, arm: &mut Arm) -> Result<(), MoveCheckError> {
        if !arm.identity().has_status_block() {
            return Ok(());
        }
        let now = arm.now();
        if let Some(answer) = arm.take_background_answer()? {
            (self.last_answer, self.unanswered) = (now, 0);
            if let Err(reason) = self.judge(&answer, now) {
                // A read of everything finds the most important reason.
                return self.read(arm).and(Err(reason));
            }
        }
        if self.unanswered >= UNANSWERED_QUESTIONS && now >= self.last_answer + SILENCE {
            return Err(MoveCheckError::Exchange(arm.no_background_answer(REGISTERS, SILENCE)));
        }
        if now >= self.next_question {
            self.next_question = now + poll_period(arm);
            self.unanswered = self.unanswered.saturating_add(1);
            let span = if self.is_state_next && self.needs_motors { STATE_REGISTERS } else { REGISTERS };
            self.is_state_next = !self.is_state_next;
            arm.ask_in_background(span)?;
        }
        Ok(())
    }

    /// Reads the registers, and judges them. `None` from firmware without a status block.
    fn read(&mut self, arm: &mut Arm) -> Result<Option<Snapshot>, MoveCheckError> {
        let state = arm.read_span(STATE_REGISTERS)?;
        self.is_gripper = state.byte(&EFFECTOR_TYPE) == GRIPPER;
        let has_status = arm.identity().has_status_block();
        let registers = has_status.then(|| arm.read_span(REGISTERS)).transpose()?;
        let now = arm.now();
        (self.last_answer, self.unanswered) = (now, 0);
        // A lost supply is the reason for motors that are off.
        registers.iter().try_for_each(|registers| self.judge(registers, now))?;
        self.judge(&state, now)?;
        Ok(registers.filter(|registers| registers.byte(&STATUS_VERSION) != 0))
    }

    /// Fails if these registers tell that the move has ended.
    fn judge(&mut self, registers: &Snapshot, now: Instant) -> Result<(), MoveCheckError> {
        if registers.span() == STATE_REGISTERS {
            self.is_gripper = registers.byte(&EFFECTOR_TYPE) == GRIPPER;
            let state = registers.byte(&MOTOR_STATE);
            return if state == motor_state::SERVO || !self.needs_motors {
                Ok(())
            } else {
                Err(MoveCheckError::NotDriven { state })
            };
        }
        let problems = self.problems(registers, now);
        if problems.is_empty() { Ok(()) } else { Err(MoveCheckError::Problems(problems)) }
    }

    fn problems(&mut self, registers: &Snapshot, now: Instant) -> Vec<Problem> {
        let mut flags = ProblemFlags::of(registers, self.is_gripper);
        self.blocked_before &= flags.blocked;
        if now < self.begun + TIME_TO_GET_FREE {
            flags.blocked &= !self.blocked_before;
        }
        let restarted = self.has_restarted(registers).then_some(Problem::of_arm(ProblemKind::Restarted));
        let all = restarted.into_iter().chain(flags.problems(self.joints));
        all.filter(|problem| self.needs_motors || problem.kind.hides_positions()).collect()
    }

    /// Has the controller restarted since the last answer? Then its counter of frames begins again, and its stream is off.
    fn has_restarted(&mut self, registers: &Snapshot) -> bool {
        if registers.byte(&STATUS_VERSION) == 0 {
            return false;
        }
        let accepted = registers.counter(&FRAMES_ACCEPTED);
        let before = self.accepted.replace(accepted).unwrap_or(accepted);
        let has_other_period =
            self.period_ms.is_some_and(|period| registers.word(SET_POINT_PERIOD.address) != period);
        has_other_period || has_restarted(before, accepted)
    }
}

/// The time between two questions, so that the line has room for points and reports.
fn poll_period(arm: &Arm) -> Duration {
    let check = Duration::from_secs(1) * BITS_PER_CHECK / arm.options().baud.max(1);
    POLL_PERIOD.max(check * SHARE_OF_LINE)
}
