//! The arm's end of the host link: decodes requests, encodes replies and reports ([D3](protocol_core::decisions#d3) to
//! [D5](protocol_core::decisions#d5), [D14](protocol_core::decisions#d14)).
//!
//! ```text
//!   bytes ──▶ Deframer ──▶ next_input ──▶ writes, damage
//!                              │
//!                              ▼
//!                        waiting read ──▶ take_read, once its reply has room ──▶ reply ──▶ frame
//!                                             Reports ──▶ take_report ──▶ report ──┘
//! ```
//!
//! A read waits until its reply fits the room of the link. All requests behind it wait, too. This file only reads
//! registers.

use protocol_core::registers::map::{FINE_TARGET, PROTECTION_VERSION};
use protocol_core::registers::{Map, RegisterFile};
use protocol_core::report_kind::ReportKind;
use protocol_core::request::{Alarm, Reply, ReportMap21, Request};
use protocol_core::time::Instant;
use protocol_core::wire::{Defect, Deframer, FrameBuffer, MIN_LENGTH, ToArm, deframer};

use crate::reports::Reports;

/// A read of `count` registers from `address` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Read {
    pub(crate) address: u8,
    pub(crate) count: u8,
}

impl Read {
    const fn fits(self, room: usize) -> bool {
        MIN_LENGTH + self.count as usize <= room
    }

    /// Does the range hold registers of the extended block or of the protection block?
    pub(crate) const fn is_extended(self) -> bool {
        // `as` widens here: `From` is not const.
        let end = self.address as usize + self.count as usize;
        end > FINE_TARGET.address as usize && self.address <= PROTECTION_VERSION.address
    }
}

/// A write or a defect in the bytes from the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HostInput<'a> {
    /// New values for the registers of a map from `address` on.
    Write { map: Map, address: u8, values: &'a [u8] },
    /// A frame whose range ends beyond address 255.
    MalformedRange { address: u8 },
    /// A frame with a wrong CRC.
    Corrupted,
}

/// The arm's end of the host link.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct HostPort {
    deframer: Deframer<ToArm>,
    /// The oldest pending request, if it is a read. The requests behind it wait in the deframer.
    waiting_read: Option<Read>,
    reports: Reports,
    /// In bits per second.
    baud: u32,
    frame: FrameBuffer,
}

impl HostPort {
    /// A port at `baud` bits per second, without reports.
    pub(crate) fn new(baud: u32) -> Self {
        Self {
            deframer: Deframer::new(deframer::gap(baud)),
            waiting_read: None,
            reports: Reports::OFF,
            baud,
            frame: FrameBuffer::new(),
        }
    }

    /// The baud rate since start, in bits per second.
    pub(crate) const fn baud(&self) -> u32 {
        self.baud
    }

    /// Takes bytes and returns how many. An empty slice states that the line is silent at `now`.
    pub(crate) fn bytes(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.deframer.push(now, bytes)
    }

    /// Records that a damaged byte came after all bytes so far.
    pub(crate) fn byte_damaged(&mut self) {
        self.deframer.break_off();
    }

    /// How many more bytes are needed before there is a new event, unless the line becomes silent.
    pub(crate) fn bytes_wanted(&self) -> usize {
        self.deframer.wanted()
    }

    /// The next write or defect; `None` if there is none, or once a read has its turn. The read then waits for room, and so
    /// do the requests behind it.
    pub(crate) fn next_input(&mut self) -> Option<HostInput<'_>> {
        if self.waiting_read.is_some() {
            return None;
        }
        let input = match self.deframer.pull()?.map(Request::from_frame) {
            Ok(Request::Read { address, count }) => {
                self.waiting_read = Some(Read { address, count });
                return None;
            }
            Ok(Request::Write { address, values }) => HostInput::Write { map: Map::V22, address, values },
            Ok(Request::WriteMap21 { address, values }) => {
                HostInput::Write { map: Map::V21, address, values }
            }
            Err(Defect::MalformedRange { address }) => HostInput::MalformedRange { address },
            Err(Defect::WrongCrc) => HostInput::Corrupted,
        };
        Some(input)
    }

    /// The waiting read, if its reply fits `room` bytes.
    pub(crate) fn take_read(&mut self, room: usize) -> Option<Read> {
        self.waiting_read.take_if(|read| read.fits(room))
    }

    /// Takes the report frequencies from the registers. They apply from `now` on.
    pub(crate) fn set_report_frequencies(&mut self, now: Instant, registers: &RegisterFile) {
        self.reports.set(now, registers, self.baud);
    }

    /// The report that is due. Replies go first, and a report that does not fit `room` is skipped
    /// ([D14](protocol_core::decisions#d14)).
    pub(crate) fn take_report(&mut self, now: Instant, room: usize) -> Option<ReportKind> {
        while let Some(kind) = self.reports.poll_due(now) {
            let (_, count) = kind.registers();
            if self.waiting_read.is_none() && MIN_LENGTH + usize::from(count) <= room {
                return Some(kind);
            }
        }
        None
    }

    pub(crate) fn reply(&mut self, read: Read, registers: &RegisterFile) -> &[u8] {
        let values = registers.read(read.address, read.count);
        Reply { address: read.address, values }.encode(&mut self.frame);
        &self.frame
    }

    pub(crate) fn report(&mut self, kind: ReportKind, registers: &RegisterFile) -> &[u8] {
        let (address, count) = kind.registers();
        let values = registers.read(address, count);
        match kind.map() {
            Map::V22 => Reply { address, values }.encode(&mut self.frame),
            Map::V21 => ReportMap21 { address, values }.encode(&mut self.frame),
        }
        &self.frame
    }

    pub(crate) fn alarm(&mut self, alarm: Alarm) -> &[u8] {
        alarm.encode(&mut self.frame);
        &self.frame
    }

    /// When the next report is due, or silence on the line has an effect. While a read waits for room, silence has no
    /// effect.
    pub(crate) fn deadline(&self) -> Instant {
        let silence = self.deframer.deadline().filter(|_| self.waiting_read.is_none());
        self.reports.due().min(silence.unwrap_or(Instant::FAR_FUTURE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::FEEDBACK_FREQUENCY;
    use protocol_core::time::Duration;

    const NOW: Instant = Instant::ZERO;

    fn port_with(requests: &[Request<'_>]) -> HostPort {
        let mut port = HostPort::new(115_200);
        for request in requests {
            let mut frame = FrameBuffer::new();
            request.encode(&mut frame);
            assert_eq!(port.bytes(NOW, &frame), frame.len());
        }
        port
    }

    #[test]
    fn d05_a_read_waits_for_the_room_of_its_own_reply() {
        let mut port = port_with(&[Request::Read { address: 54, count: 7 }]);
        assert_eq!(port.next_input(), None);
        assert_eq!(port.take_read(13), None);
        assert_eq!(port.take_read(14), Some(Read { address: 54, count: 7 }));
        assert_eq!(port.take_read(262), None, "only once");
    }

    #[test]
    fn d05_a_write_waits_only_behind_a_read() {
        let write = Request::Write { address: 46, values: &[90] };
        let input = Some(HostInput::Write { map: Map::V22, address: 46, values: &[90] });
        assert_eq!(port_with(&[write]).next_input(), input);
        let mut port = port_with(&[Request::Read { address: 0, count: 1 }, write]);
        assert_eq!(port.next_input(), None);
        assert_eq!(port.take_read(7), None);
        assert_eq!(port.deadline(), Instant::FAR_FUTURE, "only more room has an effect");
        assert!(port.take_read(8).is_some());
        assert_eq!(port.next_input(), input);
    }

    #[test]
    fn d14_a_report_without_room_is_skipped() {
        let mut port = HostPort::new(115_200);
        let mut registers = RegisterFile::new([0; 6], None);
        registers.set(FEEDBACK_FREQUENCY.address, 10);
        port.set_report_frequencies(NOW, &registers);
        let at = |number: u64| NOW + Duration::from_millis(100 * number);
        assert_eq!(port.deadline(), at(1));
        assert_eq!(port.take_report(at(1), 13), None);
        assert_eq!(port.take_report(at(1), 14), None, "it was skipped, not delayed");
        assert_eq!(port.take_report(at(2), 14), Some(ReportKind::Positions));
    }

    #[test]
    fn a_malformed_range_and_a_wrong_crc_are_distinguished() {
        let mut port = port_with(&[Request::Read { address: 250, count: 7 }]);
        assert_eq!(port.next_input(), Some(HostInput::MalformedRange { address: 250 }));
        port.bytes(NOW, &[0xAA, 0x77, 3, 0, 0, 1, 2]);
        assert_eq!(port.next_input(), Some(HostInput::Corrupted));
    }
}
