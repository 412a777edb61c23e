//! Reads whose answer is not waited for: a stream asks for the arm's health between its points.

use crate::frame_port::Received;
use crate::snapshot::Snapshot;
use crate::span::Span;

/// A read that was sent, and its answer once that has arrived.
#[derive(Debug)]
pub(crate) struct BackgroundRead {
    pub(crate) wanted: Span,
    /// What was asked for: it may be wider, so that no other answer has the same range.
    asked: Span,
    pub(crate) answer: Option<Snapshot>,
}

impl BackgroundRead {
    /// Of `wanted`, for which `asked` was sent.
    pub(crate) const fn new(wanted: Span, asked: Span) -> Self {
        Self { wanted, asked, answer: None }
    }

    /// Keeps a frame if it is the answer.
    pub(crate) fn keep(&mut self, received: &Received) {
        if let Received::Reply(reply) = received
            && reply.span() == self.asked
        {
            self.answer = Some(reply.clone());
        }
    }
}
