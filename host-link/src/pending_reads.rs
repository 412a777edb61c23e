//! Which read a reply answers.
//!
//! The arm replies in the order of the requests ([D5](protocol_core::decisions#d5)), and a reply names its registers only.
//! So:
//!
//! * A reply belongs to the oldest read that was sent with its range. The reads before that one have lost their replies.
//! * Where another range is left, no two reads on their way have the same one: the second asks for a few registers more. This
//!   also keeps a read of the present positions apart from a report ([D14](protocol_core::decisions#d14)).
//! * A read that was given up stays in the list, so that its late reply is recognised.
//! * Where no other range is left, a repeat has the range of an earlier attempt. A new read waits until it is known whether a
//!   reply to the old one comes. The reply to a marker tells: a marker is a read of another range, sent behind the old read.

use std::collections::VecDeque;

use protocol_core::time::Instant;

use crate::event::RequestId;
use crate::span::Span;

/// At most this many attempts of reads that were given up are remembered. One read asks a silent arm about ten times a second,
/// so they cover about six seconds.
const REMEMBERED: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SentRead {
    /// `None` once it was given up or answered, and for a marker.
    id: Option<RequestId>,
    asked: Span,
    /// When its reply has arrived, if the arm answers at once.
    due: Instant,
    /// Did a damaged frame come when the reply was due?
    is_damaged: bool,
}

/// The reads without a reply, oldest first. A read that was repeated is there several times.
#[derive(Clone, Debug, Default)]
pub(crate) struct PendingReads(VecDeque<SentRead>);

/// The read that a reply answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Matched {
    /// The read that the reply answers; `None` if the read was given up or answered before, or is a marker.
    pub(crate) id: Option<RequestId>,
    /// When the reply was due; `None` if a later attempt has the same range, so that the reply may be to that one.
    pub(crate) due: Option<Instant>,
    /// Reads that were sent before the answered one, oldest first: their replies are lost.
    pub(crate) lost: Vec<RequestId>,
}

/// Why a read has to wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wait {
    /// For the end of another read, which has asked for the only possible range.
    ForRead,
    /// For the reply to a marker: a read with the only possible range was given up.
    ForMarker,
}

impl PendingReads {
    /// The range to ask for: the shortest one that holds `wanted`, and that neither a pending read nor one of `reports` has.
    /// If no such range is left, a repeat asks for `wanted` itself, and the first reply counts for the earlier attempt.
    pub(crate) fn range_for(&self, id: RequestId, wanted: Span, reports: &[Span]) -> Result<Span, Wait> {
        let is_repeat = |read: &SentRead| read.id == Some(id);
        match self.free(wanted, reports) {
            Some(free) => Ok(free),
            None if self.has(&wanted, |read| read.id.is_some() && !is_repeat(read)) => Err(Wait::ForRead),
            None if self.has(&wanted, is_repeat) => Ok(wanted),
            None => Err(Wait::ForMarker),
        }
    }

    /// The shortest range that holds `wanted`, and that neither a pending read nor one of `reports` has.
    pub(crate) fn free(&self, wanted: Span, reports: &[Span]) -> Option<Span> {
        let is_free = |span: &Span| !reports.contains(span) && !self.has(span, |_| true);
        (0..=u8::MAX).map_while(|by| wanted.widened(by)).find(is_free)
    }

    /// Adds a read that was sent; `None` for a marker. Its reply is due at `due`.
    pub(crate) fn add(&mut self, id: Option<RequestId>, asked: Span, due: Instant) {
        self.0.push_back(SentRead { id, asked, due, is_damaged: false });
    }

    /// Marks a read as given up or answered. Forgets the oldest such reads if there are more than [`REMEMBERED`].
    pub(crate) fn give_up(&mut self, id: RequestId) {
        for read in self.0.iter_mut().filter(|read| read.id == Some(id)) {
            read.id = None;
        }
        let given_up = self.0.iter().filter(|read| read.id.is_none()).count();
        let mut surplus = given_up.saturating_sub(REMEMBERED);
        self.0.retain(|read| {
            let is_kept = read.id.is_some() || surplus == 0;
            surplus -= usize::from(!is_kept);
            is_kept
        });
    }

    /// Takes the read that a reply with these registers answers, and those before it; `None` if it answers none.
    pub(crate) fn take(&mut self, range: Span) -> Option<Matched> {
        let index = self.0.iter().position(|read| read.asked == range)?;
        let lost = self.0.drain(..index).filter_map(|read| read.id).collect();
        let SentRead { id, due, .. } = self.0.pop_front()?;
        Some(Matched { id, due: (!self.has(&range, |_| true)).then_some(due), lost })
    }

    /// A damaged frame came at `now`. It counts as the reply to the oldest awaited read, if that reply is due by then. Returns
    /// this read; `None` if no reply is due.
    pub(crate) fn note_damage(&mut self, now: Instant) -> Option<RequestId> {
        let read = self.0.iter_mut().find(|read| read.id.is_some() && !read.is_damaged)?;
        read.is_damaged = read.due <= now;
        read.id.filter(|_| read.is_damaged)
    }

    /// Is a reply to this read on its way?
    pub(crate) fn awaits(&self, id: RequestId) -> bool {
        self.0.iter().any(|read| read.id == Some(id) && !read.is_damaged)
    }

    /// The ranges of the reads whose replies are on their way.
    pub(crate) fn awaited(&self) -> impl Iterator<Item = Span> {
        self.0.iter().filter(|read| read.id.is_some() && !read.is_damaged).map(|read| read.asked)
    }

    fn has(&self, span: &Span, test: impl Fn(&SentRead) -> bool) -> bool {
        self.0.iter().any(|read| read.asked == *span && test(read))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The present positions, as in a report.
    const REPORT: &[Span] = &[Span::of(&protocol_core::registers::map::PRESENT_POSITION)];

    fn span(address: u8, count: u8) -> Span {
        Span::new(address, count).expect("a span")
    }

    fn ids(count: usize) -> Vec<RequestId> {
        std::iter::successors(Some(RequestId::default()), |id| Some(id.next())).take(count).collect()
    }

    fn matched(id: Option<RequestId>, lost: Vec<RequestId>) -> Matched {
        Matched { id, due: Some(Instant::ZERO), lost }
    }

    fn add(pending: &mut PendingReads, id: RequestId, wanted: Span) -> Span {
        let asked = pending.range_for(id, wanted, REPORT).expect("a range");
        pending.add(Some(id), asked, Instant::ZERO);
        asked
    }

    #[test]
    fn a_repeated_read_requests_another_range() {
        let (mut pending, ids) = (PendingReads::default(), ids(5));
        assert_eq!(add(&mut pending, ids[0], span(29, 3)), span(29, 3));
        assert_eq!(add(&mut pending, ids[1], span(29, 3)), span(29, 4));
        assert_eq!(add(&mut pending, ids[2], span(29, 4)), span(29, 5), "taken by the second");
        assert_eq!(pending.take(span(29, 4)), Some(matched(Some(ids[1]), vec![ids[0]])), "the first is lost");
        assert_eq!(add(&mut pending, ids[3], span(29, 3)), span(29, 3));
        assert_eq!(add(&mut pending, ids[4], span(29, 5)), span(29, 6), "the third still waits");
        assert_eq!(pending.take(span(29, 9)), None);
    }

    #[test]
    fn a_read_of_the_positions_differs_from_a_report() {
        assert_eq!(
            PendingReads::default().range_for(RequestId::default(), REPORT[0], REPORT),
            Ok(span(54, 8))
        );
    }

    #[test]
    fn a_late_reply_is_recognised() {
        let (mut pending, ids) = (PendingReads::default(), ids(2));
        add(&mut pending, ids[0], span(10, 4));
        pending.give_up(ids[0]);
        assert_eq!(add(&mut pending, ids[1], span(10, 4)), span(10, 5));
        assert_eq!(pending.take(span(10, 4)), Some(matched(None, vec![])));
        assert!(pending.awaits(ids[1]) && !pending.awaits(ids[0]));
    }

    #[test]
    fn a_range_without_a_wider_one_waits_for_the_read_before_and_for_a_marker() {
        let (mut pending, ids) = (PendingReads::default(), ids(2));
        let all = span(0, 255);
        add(&mut pending, ids[0], all);
        assert_eq!(pending.range_for(ids[1], all, &[]), Err(Wait::ForRead));
        assert_eq!(add(&mut pending, ids[0], all), all, "another attempt");
        let first = Matched { due: None, ..matched(Some(ids[0]), vec![]) };
        assert_eq!(pending.take(all), Some(first), "the time of no attempt is learned");
        pending.give_up(ids[0]);
        assert_eq!(pending.range_for(ids[1], all, &[]), Err(Wait::ForMarker));
        pending.add(None, span(0, 1), Instant::ZERO);
        assert_eq!(pending.take(span(0, 1)), Some(matched(None, vec![])), "no reply to the second attempt");
        assert_eq!(pending.range_for(ids[1], all, &[]), Ok(all));
    }

    #[test]
    fn the_number_of_reads_that_were_given_up_is_bounded() {
        let mut pending = PendingReads::default();
        for id in ids(1_000) {
            let asked = add(&mut pending, id, span(200, 16));
            assert!(usize::from(asked.count()) <= 16 + REMEMBERED);
            pending.give_up(id);
        }
        assert_eq!(pending.0.len(), REMEMBERED);
    }
}
