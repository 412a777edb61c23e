//! Finds out whether a 7Bot V2 is behind the port, and whether it still answers.
//!
//! ```text
//!   Absent ── the port opens ──▶ Identifying ── a 7Bot V2 answers ──▶ Present ── 3 questions missed ───▶ Silent
//!     ▲                                                                  ▲                                 │
//!     └── the port closes, from each state                               └──── a 7Bot V2 answers ──────────┘
//! ```

use protocol_core::registers::Map;
use protocol_core::registers::map::FEEDBACK_FREQUENCY;
use protocol_core::registers::map21::{ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY};
use protocol_core::time::{Duration, Instant};

use super::known_registers::KnownRegisters;
use super::line::Owner;
use super::presence::Presence;
use super::{ArmConnection, Hub};

/// Time between two questions to a port behind which no arm answers.
const IDENTIFY_PERIOD: Duration = Duration::from_millis(250);

impl Hub {
    /// From now on the arm is asked whether it answers after each second without a reply, also while no client reads.
    pub const fn watch_arm(&mut self) {
        self.presence.is_watched = true;
    }

    /// Has the arm stopped answering although its port is open? It may still receive what is sent to it.
    #[must_use]
    pub const fn is_silent(&self) -> bool {
        matches!(self.arm, ArmConnection::Silent(_))
    }

    /// Does a 7Bot V2 answer?
    #[must_use]
    pub fn has_arm(&self) -> bool {
        self.arm == ArmConnection::Present
    }

    /// From now on only the present arm is accepted, by its chip id.
    pub fn expect_same_arm(&mut self) {
        self.chip_id = Some(self.known.chip_id().to_vec());
    }

    /// The arm no longer answers. Drops the requests that wait for it, and ends the reads on their way. A hold in progress goes
    /// on.
    pub(super) fn lose_arm(&mut self, now: Instant) {
        self.arm = ArmConnection::Silent(now);
        self.line.end_reads();
        self.drop_requests();
    }

    /// If a question is due, asks which device is behind the port, or whether the arm still answers.
    pub(super) fn ask_arm(&mut self, now: Instant) {
        let due = self.question_due();
        if now < due || !self.line.is_free(now) {
            return;
        }
        let (owner, (address, count)) = match self.arm {
            ArmConnection::Present => (Owner::Presence, Presence::QUESTION),
            _ => (Owner::Identity, KnownRegisters::IDENTITY),
        };
        self.line.send_read(now, owner, address, count);
        match &mut self.arm {
            ArmConnection::Identifying(due) | ArmConnection::Silent(due) => *due = now + IDENTIFY_PERIOD,
            ArmConnection::Absent | ArmConnection::Present => self.presence.ask(now),
        }
    }

    /// When the next question to the arm is due.
    pub(super) fn question_due(&self) -> Instant {
        match self.arm {
            ArmConnection::Absent => Instant::FAR_FUTURE,
            ArmConnection::Identifying(due) | ArmConnection::Silent(due) => due,
            ArmConnection::Present => self.presence.due(self.line.is_waiting()),
        }
    }

    /// Processes the identity that a device answered. Ignores a device that is no 7Bot V2 or not the expected arm. Unless
    /// the hub is read-only, switches off the reports that an earlier program left running.
    pub(super) fn identify(&mut self, now: Instant, values: &[u8]) {
        let Some(known) = KnownRegisters::of_arm(values) else { return };
        let is_wanted = self.chip_id.as_deref().is_none_or(|id| known.chip_id() == id);
        if is_wanted && self.arm != ArmConnection::Present {
            self.arm = ArmConnection::Present;
            let before = std::mem::replace(&mut self.known, known);
            self.find_again(&before);
            self.watchdog.forget();
            if self.options.is_read_only {
                return;
            }
            for register in [ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY] {
                self.line.send_write(now, Map::V21, register.address, &[0]);
            }
            self.line.send_write(now, Map::V22, FEEDBACK_FREQUENCY.address, &[0]);
        }
    }
}
