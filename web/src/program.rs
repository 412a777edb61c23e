//! Runs a program of blocks on the arm: the page's shell around [`Interpreter`].
//!
//! ```text
//!   Interpreter ── Begin ──▶ the lit block; in single steps the program waits here
//!        │  ▲ ──── Sensor ─▶ registers of the last round ──┐
//!        │  └──────────────────────────────────────────────┘
//!        └── ProgramCommand ──▶ Confirmed: registers that the arm has to take
//!                    ──▶ ProgramMove: targets, until the joints are there as measured
//!                    ──▶ PagePlayer: a straight line
//! ```
//!
//! The program continues after a block only when the arm has carried out the block. A blocked or silent joint, a stop, or another
//! client that changes the targets of the current move ends the program.

mod command;
mod failure;
mod joint_move;
mod sensor;

use block_programs::{BlockId, Interpreter, Program, ProgramEvent};
use protocol_core::time::Instant;
use sevenbot::Snapshot;
use sevenbot::health::MoveWatch;
use sevenbot::map::{SPEED, TIME};

use command::RunStage;
pub use failure::ProgramFailure;

use crate::client::{BAUD, Client};
use crate::confirmed::{Confirmed, write_all};
use crate::interruptions::{Interruptions, ROUNDS_TO_KNOW};
use crate::movement::{PlayFailure, start_anew};
use crate::stop::since_start;

/// At most this many blocks begin in one poll. An endless loop continues in the next poll.
const BLOCKS_PER_POLL: u32 = 200;

/// What [`ProgramRun::poll`] returns: whether the program runs, waits or has ended.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramProgress {
    /// Blocks run, or the arm carries one out.
    Running,
    /// The program waits before the lit block until a person asks for the next step.
    Waiting,
    /// The program ran to its end.
    Over,
    /// The program ended early, for this reason.
    Failed(ProgramFailure),
}

/// How the program goes from one block to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunMode {
    /// It runs without a pause.
    Running,
    /// It waits for [`ProgramRun::go_on`] before each block.
    SingleSteps,
}

/// A program that runs on an arm.
#[derive(Debug)]
pub struct ProgramRun {
    interpreter: Interpreter,
    mode: RunMode,
    /// True while the program waits before a block for [`Self::go_on`].
    is_waiting: bool,
    /// The current block; `None` before the first one.
    block: Option<BlockId>,
    stage: RunStage,
    /// The registers before the program, with the speeds and times to restore.
    before: Snapshot,
    watch: MoveWatch,
    /// The round of the last registers that were checked.
    watched_round: u64,
    interruptions: Interruptions,
}

impl ProgramRun {
    /// Begins a program on an arm with these registers. Their speeds and times are restored at the end.
    #[must_use]
    pub fn new(program: &Program, mode: RunMode, registers: &Snapshot, now: Instant) -> Self {
        Self {
            interpreter: Interpreter::new(program),
            mode,
            is_waiting: false,
            block: None,
            stage: RunStage::Start,
            before: registers.clone(),
            watch: MoveWatch::new(since_start(now), 0, BAUD),
            watched_round: 0,
            interruptions: Interruptions::default(),
        }
    }

    /// The block that runs or, if the program waits, the next one. `None` before the first block.
    #[must_use]
    pub const fn block(&self) -> Option<&BlockId> {
        self.block.as_ref()
    }

    /// Does the program wait before a block?
    #[must_use]
    pub const fn is_waiting(&self) -> bool {
        self.is_waiting
    }

    /// The registers before the program, with the speeds and times that it restores.
    #[must_use]
    pub const fn before(&self) -> &Snapshot {
        &self.before
    }

    /// Continues in this mode. If the program waits, runs the next block.
    pub const fn go_on(&mut self, mode: RunMode) {
        self.mode = mode;
        self.is_waiting = false;
    }

    /// Runs the blocks that are due, and writes their frames. Call it with each picture.
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

    /// Ends the program, because something else is about to move the arm, and restores speeds and times. Moving joints hold:
    /// otherwise the restored speeds would act on their moves at once (D11).
    pub fn end(self, now: Instant, client: &mut Client) {
        if self.stage.may_move() {
            client.hold(now, self.before.joints(&SPEED));
        }
        if let RunStage::Line(player) = &self.stage {
            player.end_stream(now, client);
        }
        write_all(&self.closing_frames(), now, client);
    }

    fn fail(&self, failure: &ProgramFailure, now: Instant, client: &mut Client) {
        // The arm holds already, and the server drops targets of this client, so a stop could not be confirmed.
        let is_stopped = *failure == ProgramFailure::Arm(PlayFailure::StoppedByAnother);
        if self.stage.may_move() && !is_stopped {
            self.hold(now, client);
        } else {
            write_all(&self.closing_frames(), now, client);
        }
    }

    fn hold(&self, now: Instant, client: &mut Client) {
        client.stop(now, Some(self.before.joints(&SPEED)));
        if let RunStage::Line(player) = &self.stage {
            player.end_stream(now, client);
        }
        client.write(now, TIME.address, &self.before.joints(&TIME));
    }

    fn closing_frames(&self) -> Vec<(u8, Vec<u8>)> {
        [SPEED, TIME].map(|row| (row.address, self.before.joints(&row).to_vec())).into()
    }

    fn advance(&mut self, now: Instant, client: &mut Client) -> Result<ProgramProgress, ProgramFailure> {
        self.interruptions.check_pause(now).map_err(ProgramFailure::Arm)?;
        match self.stage {
            RunStage::Start => {
                start_anew(now, client);
                self.stage = RunStage::Beginning(client.rounds() + ROUNDS_TO_KNOW);
                return Ok(ProgramProgress::Running);
            }
            RunStage::Beginning(round) if client.rounds() < round => {
                return Ok(ProgramProgress::Running);
            }
            _ => self.watch(now, client)?,
        }
        self.run_blocks(now, client)
    }

    /// Fails if the arm has a problem or is silent, or another client has stopped the arm.
    fn watch(&mut self, now: Instant, client: &Client) -> Result<(), ProgramFailure> {
        if client.rounds() != self.watched_round {
            self.watched_round = client.rounds();
            self.interruptions.check_stops(client.registers()).map_err(ProgramFailure::Arm)?;
            self.watch.registers(since_start(now), client.registers())?;
        }
        // Fails if the arm is silent. The client reads all registers in any case, so the span to read is not needed.
        Ok(self.watch.question(since_start(now)).map(drop)?)
    }

    fn run_blocks(&mut self, now: Instant, client: &mut Client) -> Result<ProgramProgress, ProgramFailure> {
        for _ in 0..BLOCKS_PER_POLL {
            if self.is_waiting {
                return Ok(ProgramProgress::Waiting);
            }
            if !self.stage.is_done(now, client)? {
                return Ok(ProgramProgress::Running);
            }
            if matches!(self.stage, RunStage::Closing(_)) {
                return Ok(ProgramProgress::Over);
            }
            self.stage = RunStage::Ready;
            self.run_block(now, client)?;
        }
        Ok(ProgramProgress::Running)
    }

    /// Runs the interpreter until the next block begins, or until a command for the arm or the end of the program.
    fn run_block(&mut self, now: Instant, client: &mut Client) -> Result<(), ProgramFailure> {
        loop {
            match self.interpreter.advance()? {
                ProgramEvent::Begin(block) => {
                    self.block = Some(block);
                    self.is_waiting = self.mode == RunMode::SingleSteps;
                    return Ok(());
                }
                ProgramEvent::Sensor(wanted) => {
                    self.interpreter.answer(sensor::read(wanted, now, client.registers())?);
                }
                ProgramEvent::Command(command) => {
                    self.stage = command::begin(&command, now, client)?;
                    return Ok(());
                }
                ProgramEvent::Over => {
                    self.stage = RunStage::Closing(Confirmed::write(self.closing_frames(), now, client));
                    return Ok(());
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
