//! What a link tells its shell.

use protocol_core::registers::Map;
use protocol_core::request::Alarm;
use protocol_core::time::Instant;
use protocol_core::wire::Function;
use protocol_core::wire::frame::Defect;

use crate::snapshot::Snapshot;
use crate::span::Span;

/// Identifies a read of one link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct RequestId(u64);

impl RequestId {
    /// The id of the read after this one.
    pub(crate) const fn next(self) -> Self {
        Self(self.0.wrapping_add(1))
    }
}

/// What a link tells its shell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostEvent {
    /// Send these bytes to the arm: one frame.
    Send(Vec<u8>),
    /// The reply to a read: the registers that were wanted.
    Reply(RequestId, Snapshot),
    /// The read of these registers ends without a reply: the reply was lost or damaged, the arm does not answer, or the line was
    /// reset.
    NoReply(RequestId, Span),
    /// A report of the arm ([D14](protocol_core::decisions#d14), [M4](protocol_core::decisions#m4)). The map tells its form.
    Report(Map, Snapshot),
    /// An alarm of the arm ([M8](protocol_core::decisions#m8)).
    Alarm(Alarm),
    /// A good frame that answers no open read: a late reply, the reply to a read that the link sent for itself, or the echo of a
    /// write on a one-wire line. The echo of a read lacks the values of a reply, so it is [`HostEvent::Damaged`].
    Unmatched(Function, Snapshot),
    /// A frame was damaged. If it was the reply to a read, the link may repeat the read.
    Damaged(Defect),
    /// Nothing happens before this time, unless bytes come. At that time, pass the bytes that came to
    /// [`HostLink::bytes`](crate::HostLink::bytes), or an empty slice.
    Wait(Instant),
}
