//! Splits the bytes of the servo bus into frames, and re-synchronises after damage.

use super::{ENVELOPE, MAX_FRAME, ServoFrame, UNCOUNTED, checksum};

/// A complete frame has a wrong checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WrongChecksum;

/// Finds the frames of either direction in a stream of bytes.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Decoder {
    buffer: heapless::Vec<u8, { Decoder::CAPACITY }>,
    /// All bytes before the head are finished.
    head: usize,
    /// Where the last damaged byte came; 0 without one. No frame continues across it.
    damaged_at: usize,
}

/// What [`parse`] finds at the beginning of its input.
enum DecodeOutcome<'a> {
    Complete(ServoFrame<'a>),
    WrongChecksum,
    Incomplete,
    NotAFrame,
}

impl Decoder {
    /// Size of the buffer: the echo of the longest frame and an answer behind it.
    pub const CAPACITY: usize = 2 * MAX_FRAME;

    /// A decoder with an empty buffer.
    #[must_use]
    pub const fn new() -> Self {
        Self { buffer: heapless::Vec::new(), head: 0, damaged_at: 0 }
    }

    /// Takes received bytes. Beyond [`Decoder::CAPACITY`] the oldest bytes are lost, so pull between two calls.
    pub fn push(&mut self, bytes: &[u8]) {
        let newest = bytes.get(bytes.len().saturating_sub(Self::CAPACITY)..).unwrap_or(bytes);
        let excess = (self.buffer.len() + newest.len()).saturating_sub(Self::CAPACITY);
        if excess != 0 {
            self.forget(excess.max(self.head));
        }
        // Cannot fail: `forget` made room.
        let _ = self.buffer.extend_from_slice(newest);
    }

    /// Records that a damaged byte came behind all bytes so far. It belongs to no frame.
    pub fn push_damaged(&mut self) {
        if self.head < self.damaged_at {
            // Only one position is kept: drop the bytes between the two damaged ones.
            self.buffer.truncate(self.damaged_at);
        }
        self.damaged_at = self.buffer.len();
    }

    /// The next frame or wrong checksum; `None` if more bytes are needed. Call it until it returns `None`. After a wrong
    /// checksum the search continues with the next byte, so the frame behind a damaged one is found.
    pub fn pull(&mut self) -> Option<Result<ServoFrame<'_>, WrongChecksum>> {
        loop {
            let is_before_damage = self.head < self.damaged_at;
            let end = if is_before_damage { self.damaged_at } else { self.buffer.len() };
            match parse(self.buffer.get(self.head..end)?) {
                DecodeOutcome::Incomplete if !is_before_damage => return None,
                DecodeOutcome::Incomplete | DecodeOutcome::NotAFrame => self.head += 1,
                DecodeOutcome::WrongChecksum => {
                    self.head += 1;
                    return Some(Err(WrongChecksum));
                }
                DecodeOutcome::Complete(frame) => {
                    self.head += ENVELOPE + frame.params.len();
                    return Some(Ok(frame));
                }
            }
        }
    }

    /// Forgets all bytes taken so far, and a damaged one.
    pub fn clear(&mut self) {
        *self = Self::new();
    }

    fn forget(&mut self, count: usize) {
        let mut kept = heapless::Vec::new();
        // Cannot fail: both buffers have the same size.
        let _ = kept.extend_from_slice(self.buffer.get(count..).unwrap_or(&[]));
        self.buffer = kept;
        self.head = self.head.saturating_sub(count);
        self.damaged_at = self.damaged_at.saturating_sub(count);
    }
}

/// Parses the frame at the beginning of `bytes`. No servo has the id FF, so in FF FF FF the header begins one byte
/// later.
fn parse(bytes: &[u8]) -> DecodeOutcome<'_> {
    match bytes {
        [] | [0xFF] | [0xFF, 0xFF] => DecodeOutcome::Incomplete,
        [0xFF, 0xFF, 0xFF, ..] => DecodeOutcome::NotAFrame,
        [0xFF, 0xFF, rest @ ..] => parse_body(rest),
        _ => DecodeOutcome::NotAFrame,
    }
}

/// Parses the bytes behind the header.
fn parse_body(body: &[u8]) -> DecodeOutcome<'_> {
    let Some(&length) = body.get(1) else { return DecodeOutcome::Incomplete };
    let length = usize::from(length);
    if !(2..=MAX_FRAME - UNCOUNTED).contains(&length) {
        return DecodeOutcome::NotAFrame;
    }
    match body.get(..2 + length) {
        Some([covered @ .., sum]) if checksum(covered) != *sum => DecodeOutcome::WrongChecksum,
        Some([id, _, code, params @ .., _]) => {
            DecodeOutcome::Complete(ServoFrame { id: *id, code: *code, params })
        }
        _ => DecodeOutcome::Incomplete,
    }
}
