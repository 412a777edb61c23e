//! Receive buffer of the peers: bytes go in at the end and frames are taken from the front. The remaining bytes
//! are moved only when room is needed.

/// Room for two of the longest Modbus frames (256 bytes each) and more than one piece of the stream.
const CAPACITY: usize = 1024;

/// Bytes that were received and not yet consumed.
pub(crate) struct Inbox {
    bytes: [u8; CAPACITY],
    start: usize,
    end: usize,
}

impl Inbox {
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; CAPACITY], start: 0, end: 0 }
    }

    /// Adds bytes at the end. If there is no room, the piece is dropped. The servers here consume frames early
    /// enough that this does not happen.
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

    /// The bytes not yet consumed.
    pub(crate) fn bytes(&self) -> &[u8] {
        self.bytes.get(self.start..self.end).unwrap_or(&[])
    }

    /// Removes bytes from the front.
    pub(crate) fn take(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        }
    }
}
