//! Checks during a move whether the arm still carries out the move, and gives the reason if it does not.
//!
//! ```text
//!   MoveCheck::begin ──▶ check, check, ... (waits for the answer)   ──▶ Ok, or MoveCheckError
//!                    └─▶ poll, poll, ...   (does not wait: a stream) ──▶ the same
//! ```
//!
//! A driven joint that is blocked, let go or silent ends the move, and so do a lost supply and a restart of the controller.
//! Firmware without a status block reports none of these.

use protocol_core::registers::map::{MISSING_SERVOS, MOVING_JOINTS};

use super::Problem;
use super::problem::sentences;
use super::watch::{MoveFault, MoveWatch, REGISTERS, SILENCE, STATE_REGISTERS};
use crate::arm::Arm;
use crate::checked_write::ServerReason;
use crate::error::Error;
use host_link::Snapshot;

/// Why an arm does not carry out a move.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MoveCheckError {
    /// These problems end the move. [`ProblemKind::remedy`](super::ProblemKind::remedy) says what to do.
    #[error("{}", sentences(.0))]
    Problems(Vec<Problem>),
    /// The motors do not drive the joints.
    #[error("the arm's motors are in state {state}: they do not drive the joints")]
    NotDriven {
        /// The value of register 29.
        state: u8,
    },
    /// Another program stopped the arm through the server that both use, or ended this program's stream.
    #[error("{}", ServerReason::Stopped)]
    StoppedByAnother,
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
pub struct MoveCheck(MoveWatch);

/// What an arm does during a move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MoveState {
    /// The joints whose set-point moves, as [`Joint::bit`](crate::Joint::bit)s; `None` if the firmware does not tell.
    pub moving: Option<u8>,
    /// The joints whose servo does not answer, likewise; 0 if the firmware does not tell.
    pub missing: u8,
    /// Does joint 7, a gripper, hold something?
    pub is_gripping: bool,
}

impl MoveCheck {
    /// Begins to watch over these joints, as [`Joint::bit`](crate::Joint::bit)s.
    ///
    /// # Errors
    /// [`MoveCheckError::Problems`] if a joint cannot be driven now. A blocked joint can: its next target tries again.
    /// [`MoveCheckError::NotDriven`] if the motors are off, [`MoveCheckError::StoppedByAnother`], and the errors of [`Arm::read`].
    pub fn begin(arm: &mut Arm, joints: u8) -> Result<Self, MoveCheckError> {
        let mut check = Self::idle(arm, joints);
        check.read(arm)?;
        Ok(check)
    }

    /// Begins to watch over the positions of all joints, for a measurement: the motors may be off. Sends nothing yet.
    pub fn of_positions(arm: &mut Arm) -> Self {
        Self(Self::idle(arm, 0).0.of_positions())
    }

    /// Begins to watch over these joints. Sends nothing yet.
    pub(crate) fn idle(arm: &mut Arm, joints: u8) -> Self {
        // The answer to a question of the previous move would be out of date.
        arm.forget_background_question();
        Self(MoveWatch::new(arm.elapsed(), joints, arm.options().baud))
    }

    /// See [`MoveWatch::with_period`].
    #[must_use]
    pub const fn with_period(self, milliseconds: u16) -> Self {
        Self(self.0.with_period(milliseconds))
    }

    /// The watched joints, as [`Joint::bit`](crate::Joint::bit)s.
    #[must_use]
    pub const fn joints(&self) -> u8 {
        self.0.joints()
    }

    /// Watches over these joints, too, from now on.
    pub(crate) fn add_joints(&mut self, joints: u8, arm: &Arm) {
        self.0.add_joints(joints, arm.elapsed());
    }

    /// Asks the arm, and waits for its answer.
    ///
    /// # Errors
    /// [`MoveCheckError::Problems`], [`MoveCheckError::NotDriven`] or [`MoveCheckError::StoppedByAnother`]: the move has ended.
    /// Also the errors of [`Arm::read`].
    pub fn check(&mut self, arm: &mut Arm) -> Result<MoveState, MoveCheckError> {
        let registers = self.read(arm)?;
        Ok(registers.map_or_else(MoveState::default, |registers| MoveState {
            moving: Some(registers.byte(&MOVING_JOINTS)),
            missing: registers.byte(&MISSING_SERVOS),
            is_gripping: self.0.is_gripping(&registers),
        }))
    }

    /// See [`MoveWatch::end`].
    pub(crate) const fn end(&mut self) {
        self.0.end();
    }

    /// Checks the answer that has arrived, and asks again when it is time. Waits only after a fault, to read its cause. Does
    /// nothing for firmware without a status block.
    ///
    /// # Errors
    /// As [`Self::check`]. Also [`MoveCheckError::Exchange`] if no answer came for 1.5 s, to three questions or more.
    pub fn poll(&mut self, arm: &mut Arm) -> Result<(), MoveCheckError> {
        if !arm.identity().has_status_block() {
            return Ok(());
        }
        if let Some(answer) = arm.take_background_answer()?
            && let Err(fault) = self.0.registers(arm.elapsed(), &answer)
        {
            // A read of everything finds the most important reason.
            return self.read(arm).and(Err(told(arm, fault)));
        }
        let question = self.0.question(arm.elapsed());
        if let Some(span) = question.map_err(|fault| told(arm, fault))? {
            arm.ask_in_background(span)?;
        }
        Ok(())
    }

    /// Reads the registers, and checks them. `None` from firmware without a status block.
    fn read(&mut self, arm: &mut Arm) -> Result<Option<Snapshot>, MoveCheckError> {
        let mut registers = arm.read_span(STATE_REGISTERS)?;
        if arm.identity().has_status_block() {
            let mut all = Snapshot { address: 0, values: vec![0; 256] };
            [registers, arm.read_span(REGISTERS)?].iter().for_each(|read| all.put(read));
            registers = all;
        }
        self.0.registers(arm.elapsed(), &registers).map_err(|fault| told(arm, fault))?;
        Ok(Some(registers).filter(Snapshot::has_status_block))
    }
}

fn told(arm: &mut Arm, fault: MoveFault) -> MoveCheckError {
    match fault {
        MoveFault::Problems(problems) => MoveCheckError::Problems(problems),
        MoveFault::NotDriven { state } => MoveCheckError::NotDriven { state },
        MoveFault::StoppedByAnother => MoveCheckError::StoppedByAnother,
        MoveFault::Silent => MoveCheckError::Exchange(arm.no_background_answer(REGISTERS, SILENCE)),
    }
}
