//! Runs a program of blocks on the arm: the shell of the page round [`Interpreter`].
//!
//! ```text
//!   Interpreter ── Begin ──▶ the lit block; in single steps the program waits here
//!        │  ▲ ──── Sensor ─▶ registers of the last round ──┐
//!        │  └──────────────────────────────────────────────┘
//!        └── Command ──▶ Confirmed: registers that the arm has to take
//!                    ──▶ JointMove: targets, until the joints are there as measured
//!                    ──▶ Player: a straight line
//! ```
//!
//! The program goes on only if the arm has done what the block says. A blocked or silent joint, a stop, or another program that
//! moves the arm end it.

mod command;
mod failure;
mod joint_move;
mod sensor;

use block_programs::{BlockId, Event, Interpreter, Program};
use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::health::MoveWatch;
use sevenbot::map::{SPEED, TIME};

use command::Action;
pub use failure::ProgramFailure;

use crate::client::{BAUD, Client};
use crate::confirmed::{Confirmed, write_all};
use crate::interruptions::{Interruptions, ROUNDS_TO_KNOW};
use crate::movement::{PlayFailure, start_anew};
use crate::stop::since_start;

/// So many blocks begin in one call at most. An endless loop goes on in the next call.
const BLOCKS_PER_POLL: u32 = 200;

/// How a program goes on or has ended.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramProgress {
    /// It goes on.
    Running,
    /// It waits before the lit block, for the next step.
    Waiting,
    /// It has come to its end.
    Over,
    /// It has ended before, for this reason.
    Failed(ProgramFailure),
}

/// Does the program stop before each block?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// No.
    Running,
    /// Yes.
    SingleSteps,
}

/// A program that runs on an arm.
#[derive(Debug)]
pub struct ProgramRun {
    interpreter: Interpreter,
    pace: Pace,
    /// It waits before a block, for the next step.
    is_waiting: bool,
    /// The block that runs.
    block: Option<BlockId>,
    action: Action,
    /// The registers before it: speeds and times.
    before: Snapshot,
    watch: MoveWatch,
    /// The last registers that were watched are those of this round.
    watched_round: u64,
    interruptions: Interruptions,
}

impl ProgramRun {
    /// Begins a program on an arm with these registers.
    #[must_use]
    pub fn new(program: &Program, pace: Pace, registers: &Snapshot, now: Instant) -> Self {
        Self {
            interpreter: Interpreter::new(program),
            pace,
            is_waiting: false,
            block: None,
            action: Action::Start,
            before: registers.clone(),
            watch: MoveWatch::new(since_start(now), 0, BAUD),
            watched_round: 0,
            interruptions: Interruptions::default(),
        }
    }

    /// The block that runs, or is the next one.
    #[must_use]
    pub const fn block(&self) -> Option<&BlockId> {
        self.block.as_ref()
    }

    /// Does it wait for the next step?
    #[must_use]
    pub const fn is_waiting(&self) -> bool {
        self.is_waiting
    }

    /// The registers before it. It restores the speeds and times.
    #[must_use]
    pub const fn before(&self) -> &Snapshot {
        &self.before
    }

    /// Does the next block if the program waits, and goes on at this pace.
    pub const fn go_on(&mut self, pace: Pace) {
        self.pace = pace;
        self.is_waiting = false;
    }

    /// Writes what is due, and runs the blocks that are.
    pub fn poll(&mut self, now: Instant, client: &mut Client) -> ProgramProgress {
        match self.advance(now, client) {
            Ok(progress) => progress,
            Err(failure) => {
                self.fail(&failure, now, client);
                ProgramProgress::Failed(failure)
            }
        }
    }

    /// Makes the arm hold, and ends the program.
    pub fn stop(self, now: Instant, client: &mut Client) {
        self.hold(now, client);
    }

    /// Ends the program, because something else moves the arm now. Joints that are on their way hold: with the speeds of before they
    /// would go on, and faster (D11).
    pub fn end(self, now: Instant, client: &mut Client) {
        if self.action.may_move() {
            client.hold(now, self.before.joints(&SPEED));
        }
        if let Action::Line(player) = &self.action {
            player.end_stream(now, client);
        }
        write_all(&self.closing_frames(), now, client);
    }

    fn fail(&self, failure: &ProgramFailure, now: Instant, client: &mut Client) {
        // The arm holds then, and does not take a stop of this program.
        let is_stopped = *failure == ProgramFailure::Arm(PlayFailure::StoppedByAnother);
        if self.action.may_move() && !is_stopped {
            self.hold(now, client);
        } else {
            write_all(&self.closing_frames(), now, client);
        }
    }

    fn hold(&self, now: Instant, client: &mut Client) {
        client.stop(now, Some(self.before.joints(&SPEED)));
        if let Action::Line(player) = &self.action {
            player.end_stream(now, client);
        }
        client.write(now, TIME.address, &self.before.joints(&TIME));
    }

    fn closing_frames(&self) -> Vec<(u8, Vec<u8>)> {
        [SPEED, TIME].map(|row| (row.address, self.before.joints(&row).to_vec())).into()
    }

    fn advance(&mut self, now: Instant, client: &mut Client) -> Result<ProgramProgress, ProgramFailure> {
        self.interruptions.check_pause(now).map_err(ProgramFailure::Arm)?;
        match self.action {
            Action::Start => {
                start_anew(now, client);
                self.action = Action::Beginning(client.rounds() + ROUNDS_TO_KNOW);
                return Ok(ProgramProgress::Running);
            }
            Action::Beginning(round) if client.rounds() < round => return Ok(ProgramProgress::Running),
            _ => self.watch(now, client)?,
        }
        self.run_blocks(now, client)
    }

    /// Fails if the arm does not do what the program wants, or another program has stopped it.
    fn watch(&mut self, now: Instant, client: &Client) -> Result<(), ProgramFailure> {
        if client.rounds() != self.watched_round {
            self.watched_round = client.rounds();
            self.interruptions.check_stops(client.registers()).map_err(ProgramFailure::Arm)?;
            self.watch.registers(since_start(now), client.registers())?;
        }
        // The rounds of reads answer the questions.
        Ok(self.watch.question(since_start(now)).map(drop)?)
    }

    fn run_blocks(&mut self, now: Instant, client: &mut Client) -> Result<ProgramProgress, ProgramFailure> {
        for _ in 0..BLOCKS_PER_POLL {
            if self.is_waiting {
                return Ok(ProgramProgress::Waiting);
            }
            if !self.action.is_done(now, client)? {
                return Ok(ProgramProgress::Running);
            }
            if matches!(self.action, Action::Closing(_)) {
                return Ok(ProgramProgress::Over);
            }
            self.action = Action::Ready;
            self.run_block(now, client)?;
        }
        Ok(ProgramProgress::Running)
    }

    /// Goes on until a block begins, or the arm has something to do.
    fn run_block(&mut self, now: Instant, client: &mut Client) -> Result<(), ProgramFailure> {
        loop {
            match self.interpreter.advance()? {
                Event::Begin(block) => {
                    self.block = Some(block);
                    self.is_waiting = self.pace == Pace::SingleSteps;
                    return Ok(());
                }
                Event::Sensor(wanted) => {
                    self.interpreter.answer(sensor::read(wanted, now, client.registers())?);
                }
                Event::Command(command) => {
                    self.action = command::begin(&command, now, client)?;
                    return Ok(());
                }
                Event::Over => {
                    self.action = Action::Closing(Confirmed::write(self.closing_frames(), now, client));
                    return Ok(());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
