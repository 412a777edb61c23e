//! A buffer for the peers' streams: bytes go in at the end, frames go out at the front, and what is left is
//! moved only when room is needed.

/// Twice the longest Modbus frame and a piece.
const CAPACITY: usize = 1024;

/// Bytes that came and were not used yet.
pub(crate) struct Inbox {
    bytes: [u8; CAPACITY],
    start: usize,
    end: usize,
}

impl Inbox {
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; CAPACITY], start: 0, end: 0 }
    }

    /// Adds bytes at the end. Without room for them the oldest are lost; no server here lets it come to that.
    pub(crate) fn push(&mut self, piece: &[u8]) {
        if self.end + piece.len() > CAPACITY {
            self.bytes.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
        }
        if let Some(room) = self.bytes.get_mut(self.end..self.end + piece.len()) {
            room.copy_from_slice(piece);
            self.end += piece.len();
        }
    }

    /// The bytes not used yet.
    pub(crate) fn bytes(&self) -> &[u8] {
        self.bytes.get(self.start..self.end).unwrap_or(&[])
    }

    /// Takes bytes off the front.
    pub(crate) fn take(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        }
    }
}
