//! Whether the torque switch of a servo that should hold torque is on, as far as it is known
//! ([D28](protocol_core::decisions#d28), [D29](protocol_core::decisions#d29)).
//!
//! ```text
//!                 read: on                 a question was not answered
//!   Ordered ───────────────────▶ On ─────────────────────────────────────▶ Doubtful: nothing is sent but questions
//!      │                         ▲ │                                          │
//!      │ read: off, twice        │ │ read: off, twice            read: on ────┘ (back to On)
//!      ▼                         │ ▼
//!   the order was lost           └ it let go
//! ```

/// Two answers have to say that torque is off: one of 256 damaged answers passes its checksum.
const CONFIRMED_BY: u8 = 2;

/// What is known of a torque switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Known {
    /// Torque was ordered, and no read has shown the switch on since.
    Ordered,
    /// The last read that is trusted showed the switch on.
    On,
    /// Since the switch was read, a question was not answered, an answer was processed late, or the servo was not heard for
    /// long.
    Doubtful,
}

/// What an answer says of a torque switch that should be on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TorqueFound {
    AsBefore,
    /// The order to switch torque on was lost.
    OrderLost,
    /// The switch is off. It was on, or a question was not answered since the order.
    Lost,
}

/// The torque switch of one servo.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct TorqueCheck {
    known: Known,
    /// Successive answers that say off.
    offs: u8,
    /// A read has shown the switch on since torque was last refreshed.
    is_fresh: bool,
}

impl TorqueCheck {
    /// Torque is to be switched on.
    pub(crate) const ORDERED: Self = Self { known: Known::Ordered, offs: 0, is_fresh: false };

    /// Records that a question was not answered. The count of answers that say off goes on, because some servos answer only every
    /// second question.
    pub(crate) const fn unanswered(&mut self) {
        self.doubt();
    }

    /// Records that the switch may have gone off unnoticed.
    pub(crate) const fn doubt(&mut self) {
        self.known = Known::Doubtful;
        self.is_fresh = false;
    }

    /// Takes the state of the switch from an answer; `None` if the answer does not hold it.
    pub(crate) fn answered(&mut self, has_torque: Option<bool>) -> TorqueFound {
        match has_torque {
            None => TorqueFound::AsBefore,
            Some(true) => {
                *self = Self { known: Known::On, offs: 0, is_fresh: true };
                TorqueFound::AsBefore
            }
            Some(false) => {
                self.offs = self.offs.saturating_add(1);
                self.is_fresh = false;
                match self.known {
                    _ if self.offs < CONFIRMED_BY => TorqueFound::AsBefore,
                    Known::Ordered => TorqueFound::OrderLost,
                    Known::On | Known::Doubtful => TorqueFound::Lost,
                }
            }
        }
    }

    /// May goals and torque be sent to the servo?
    pub(crate) fn is_trusted(self) -> bool {
        self.known != Known::Doubtful && self.offs == 0
    }

    /// Does the next question have to read the switch, even if no refresh of torque is near?
    pub(crate) fn is_urgent(self) -> bool {
        self.known != Known::On || self.offs > 0
    }

    /// Has a read shown the switch on since torque was last refreshed?
    pub(crate) const fn is_fresh(self) -> bool {
        self.is_fresh
    }

    pub(crate) const fn refreshed(&mut self) {
        self.is_fresh = false;
    }
}
