//! Reads without a reply, so that a late reply is not taken for the reply to another read.
//!
//! A reply is identified by its range only, and the arm replies in the order of the requests (D5). So no two pending
//! reads have the same range: the second asks for a few registers more. This also keeps a read of the present
//! positions apart from the reports (D14).

use std::collections::VecDeque;

use crate::span::Span;

/// At most this many pending reads are remembered. No reply is later than this many reads.
const REMEMBERED: usize = 16;

/// The reads without a reply, oldest first.
#[derive(Debug, Default)]
pub(crate) struct PendingReads(VecDeque<Span>);

impl PendingReads {
    /// Adds a read of `wanted`. Returns the span to request: wider where `wanted` is pending already, or is one of `reports`. A
    /// span of more than 239 registers may have no room to be widened.
    pub(crate) fn add(&mut self, wanted: Span, reports: &[Span]) -> Span {
        let is_free = |span: &Span| !reports.contains(span) && !self.0.contains(span);
        let asked = (0..=u8::MAX).map_while(|by| wanted.widened(by)).find(is_free).unwrap_or(wanted);
        if self.0.len() >= REMEMBERED {
            self.0.pop_front();
        }
        self.0.push_back(asked);
        asked
    }

    /// Removes the read with this reply, and those before it: their replies are lost.
    pub(crate) fn replied(&mut self, span: Span) {
        if let Some(index) = self.0.iter().position(|&pending| pending == span) {
            self.0.drain(..=index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(address: u8, count: u8) -> Span {
        Span::new(address, count).expect("a span")
    }

    const REPORT: &[Span] = &[Span::of(&protocol_core::registers::map::PRESENT_POSITION)];

    #[test]
    fn a_repeated_read_requests_another_span() {
        let mut pending = PendingReads::default();
        assert_eq!(pending.add(span(29, 3), REPORT), span(29, 3));
        assert_eq!(pending.add(span(29, 3), REPORT), span(29, 4));
        assert_eq!(pending.add(span(29, 4), REPORT), span(29, 5), "taken by the second");
        pending.replied(span(29, 4));
        assert_eq!(pending.add(span(29, 3), REPORT), span(29, 3), "the first is lost");
        assert_eq!(pending.add(span(29, 5), REPORT), span(29, 6), "the third still waits");
    }

    #[test]
    fn a_read_of_the_positions_differs_from_a_report() {
        assert_eq!(PendingReads::default().add(REPORT[0], REPORT), span(54, 8));
    }

    #[test]
    fn the_number_of_pending_reads_is_bounded() {
        let mut pending = PendingReads::default();
        for _ in 0..1_000 {
            let asked = pending.add(span(240, 16), REPORT);
            assert!(usize::from(asked.count()) <= 16 + REMEMBERED);
        }
        assert_eq!(pending.add(span(0, 255), REPORT), span(0, 255));
        assert_eq!(pending.add(span(0, 255), REPORT), span(0, 255), "there is no room for another range");
    }
}
