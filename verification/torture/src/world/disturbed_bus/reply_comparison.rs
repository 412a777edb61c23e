//! Compares the replies that the controller receives with those that the servos sent.
//!
//! One corrupted reply in 256 has a valid checksum. A reply may come in parts, and each part may be corrupted or delayed by
//! itself, so both sides are decoded as streams.

use std::collections::VecDeque;

use motion_core::servo_bus::frame::{Decoder, Reading};
use protocol_core::registers::Joint;

/// The number of kept replies: twice as many as the servos send during the longest delay on the wire, 40 ms.
const MAX_KEPT: usize = 64;

/// A reply: its joint and its parameters.
type Reply = (Joint, Vec<u8>);

/// The replies of all servos, as they were sent and as they are received.
#[derive(Debug)]
pub(super) struct ReplyComparison {
    sent: Decoder,
    received: Decoder,
    /// The last replies that were sent.
    sent_replies: VecDeque<Reply>,
}

impl ReplyComparison {
    pub(super) const fn new() -> Self {
        Self { sent: Decoder::new(), received: Decoder::new(), sent_replies: VecDeque::new() }
    }

    /// The controller asks a servo, and forgets the bytes of an incomplete reply.
    pub(super) fn asked(&mut self) {
        self.sent.clear();
        self.received.clear();
    }

    /// Records the replies in the bytes that the servos send.
    pub(super) fn sent(&mut self, bytes: &[u8]) {
        for reply in replies(&mut self.sent, bytes) {
            if self.sent_replies.len() == MAX_KEPT {
                self.sent_replies.pop_front();
            }
            self.sent_replies.push_back(reply);
        }
    }

    /// Decodes bytes that the controller receives. Returns the joints of replies that no servo sent.
    pub(super) fn received(&mut self, bytes: &[u8]) -> Vec<Joint> {
        let received = replies(&mut self.received, bytes);
        let is_false = |reply: &Reply| !self.sent_replies.contains(reply);
        received.into_iter().filter(is_false).map(|(joint, _)| joint).collect()
    }
}

/// The replies that are complete with these bytes.
fn replies(decoder: &mut Decoder, bytes: &[u8]) -> Vec<Reply> {
    let mut found = Vec::new();
    for piece in bytes.chunks(Decoder::CAPACITY / 2) {
        decoder.push(piece);
        while let Some(result) = decoder.pull() {
            let reply = result.ok().filter(|frame| frame.params.len() >= usize::from(Reading::REGISTERS));
            let reply = reply.and_then(|frame| Some((Joint::from_index(frame.id)?, frame.params.to_vec())));
            found.extend(reply);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use motion_core::servo_bus::frame::{ServoFrameBuffer, status};

    use super::*;

    /// A reply of the servo of joint 3 whose last parameter and checksum are 0.
    fn reply() -> ServoFrameBuffer {
        let mut frame = ServoFrameBuffer::new();
        status(&mut frame, 2, 0, &[0, 1, 0, 0, 0, 0, 0, 241, 0]);
        assert_eq!(frame.last(), Some(&0));
        frame
    }

    #[test]
    fn a_corrupted_reply_with_a_valid_checksum_is_found_also_in_parts() {
        let reply = reply();
        // A doubled zero shifts all parameters. The last one takes the place of the checksum, which stays valid.
        let (head, tail) = reply.split_at(9);
        let doubled = [&head[..6], &[0], &head[6..]].concat();
        let mut comparison = ReplyComparison::new();
        comparison.asked();
        comparison.sent(head);
        assert!(comparison.received(&doubled).is_empty(), "incomplete");
        comparison.sent(tail);
        assert_eq!(comparison.received(tail), [Joint::ALL[2]]);
    }

    #[test]
    fn a_true_reply_is_not_false_in_parts_or_late() {
        let reply = reply();
        let mut comparison = ReplyComparison::new();
        for split in 0..=reply.len() {
            comparison.asked();
            comparison.sent(&reply);
            let (head, tail) = reply.split_at(split);
            assert!(comparison.received(head).is_empty() && comparison.received(tail).is_empty());
        }
        comparison.asked();
        assert!(comparison.received(&reply).is_empty(), "delayed");
    }
}
