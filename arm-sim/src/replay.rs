//! Replays a session: repeats the recorded inputs on a new arm, and compares the bytes that the arm sends.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::fmt::{self, Display, Formatter};

use motion_core::Controller;
use protocol_core::time::Instant;

use crate::controller::ArmController;
use crate::flash::{Flash, Memory};
use crate::plant::Plant;
use crate::servo::ServoConfig;
use crate::session::{ControllerKind, Entry, HeaderError, Hex, NoEntry, SessionEvent, SessionHeader};
use crate::simulated_arm::{ArmConfig, SimulatedArm};
use crate::stock_controller::StockController;

/// The arm sent other bytes than in the session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// When the host took the bytes.
    pub now: Instant,
    /// The bytes that the host took at this time in the session.
    pub recorded: Vec<u8>,
    /// The bytes of the replaying arm, at most as many as were recorded.
    pub replayed: Vec<u8>,
}

impl Display for Difference {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let Self { now, recorded, replayed } = self;
        let same = recorded.iter().zip(replayed).take_while(|(one, other)| one == other).count();
        let micros = now.as_micros();
        let (recorded, replayed) = (Hex(recorded), Hex(replayed));
        write!(out, "at {}.{:06} s the arm sent '{replayed}', and ", micros / 1_000_000, micros % 1_000_000)?;
        write!(out, "in the session '{recorded}': byte {} differs", same + 1)
    }
}

/// Why a session cannot be replayed, or where the replay differs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// The first two lines are not the header of a session.
    #[error(transparent)]
    Header(#[from] HeaderError),
    /// A line is not an entry.
    #[error("line {line}: {reason}")]
    Line {
        /// Its number; the first is 1.
        line: usize,
        /// The forms that an entry can have.
        reason: NoEntry,
    },
    /// A line goes back in time.
    #[error("line {line} is earlier than the one before")]
    Backwards {
        /// Its number; the first is 1.
        line: usize,
    },
    /// The arm sent other bytes than in the session.
    #[error("line {line}: {difference}")]
    Different {
        /// The number of the line that differs; the first is 1.
        line: usize,
        /// The bytes of the session and of the replaying arm, and when the host took them.
        difference: Difference,
    },
}

/// An arm with either controller.
trait ReplayedArm {
    fn now(&self) -> Instant;
    fn apply(&mut self, entry: &Entry) -> Result<(), Difference>;
}

impl<C: ArmController> ReplayedArm for SimulatedArm<Flash, Plant, C> {
    fn now(&self) -> Instant {
        self.now()
    }

    fn apply(&mut self, entry: &Entry) -> Result<(), Difference> {
        match &entry.event {
            SessionEvent::Advanced(is_idle) => self.advance(entry.now, *is_idle),
            SessionEvent::Sent(bytes) => {
                self.host_send(entry.now, bytes);
            }
            SessionEvent::Acted(action) => {
                self.act(entry.now, action.clone());
            }
            SessionEvent::Taken(recorded) => {
                let mut replayed = Vec::new();
                while replayed.len() < recorded.len() && !self.host_received().is_empty() {
                    let missing = recorded.len() - replayed.len();
                    let piece = self.host_received().get(..missing).unwrap_or(self.host_received()).to_vec();
                    self.host_take(piece.len());
                    replayed.extend(piece);
                }
                if replayed != *recorded {
                    return Err(Difference { now: entry.now, recorded: recorded.clone(), replayed });
                }
            }
        }
        Ok(())
    }
}

/// A session that is replayed line by line.
pub struct Replay {
    arm: Box<dyn ReplayedArm>,
    line: usize,
}

impl fmt::Debug for Replay {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        out.debug_struct("Replay").field("line", &self.line).finish_non_exhaustive()
    }
}

impl Replay {
    /// Powers up an arm of the kind and with the settings of the header.
    #[must_use]
    pub fn new(header: &SessionHeader) -> Self {
        let arm: Box<dyn ReplayedArm> = match header.controller {
            ControllerKind::Sevenbot => Box::new(power_up::<Controller>(header)),
            ControllerKind::Maker => Box::new(power_up::<StockController>(header)),
        };
        Self { arm, line: 2 }
    }

    /// Replays a whole session. Returns the number of its lines.
    ///
    /// # Errors
    /// The text is not a session, or the arm sends other bytes.
    pub fn run(text: &str) -> Result<usize, ReplayError> {
        let mut lines = text.lines();
        let mut head = || lines.next().unwrap_or_default();
        let mut replay = Self::new(&SessionHeader::parse(head(), head())?);
        lines.try_for_each(|line| replay.line(line))?;
        Ok(replay.line)
    }

    /// Replays the next line. The two lines of the header are not passed to this function.
    ///
    /// # Errors
    /// The line is not an entry, its time is before the previous line, or the arm has sent other bytes.
    pub fn line(&mut self, text: &str) -> Result<(), ReplayError> {
        self.line += 1;
        let line = self.line;
        let entry: Entry = text.parse().map_err(|reason| ReplayError::Line { line, reason })?;
        if entry.now < self.arm.now() {
            return Err(ReplayError::Backwards { line });
        }
        self.arm.apply(&entry).map_err(|difference| ReplayError::Different { line, difference })
    }
}

fn power_up<C: ArmController>(header: &SessionHeader) -> SimulatedArm<Flash, Plant, C> {
    let &SessionHeader { chip_id, is_paced, torque_codes, .. } = header;
    let plant = Plant::with_config(Instant::ZERO, ServoConfig { torque_codes, ..ServoConfig::default() });
    let flash = Flash::on(Memory::holding(header.settings.clone()));
    let config = ArmConfig { chip_id, is_paced, torque_codes };
    let mut arm = SimulatedArm::power_up(Instant::ZERO, config, flash, plant);
    arm.set_seed(header.seed);
    if header.is_bytewise {
        arm.set_bytewise_line();
    }
    arm
}
