//! A queue of bytes between an interrupt and the main loop.
//!
//! Interrupt and loop access it in critical sections. So, unlike `heapless::spsc::Queue`, it needs no atomic indices, and it
//! moves many bytes at once: 7 instructions for each byte that the loop queues, instead of 16.

/// A queue of up to `N` bytes. `N` is a power of two.
pub struct ByteQueue<const N: usize> {
    bytes: [u8; N],
    /// Index of the oldest byte.
    first: usize,
    len: usize,
}

impl<const N: usize> ByteQueue<N> {
    /// An empty queue.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two(), "an index wraps by masking") };
        Self { bytes: [0; N], first: 0, len: 0 }
    }

    /// Number of queued bytes.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// True if no byte is queued.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// True if there is no room.
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.len == N
    }

    /// Number of bytes that can be queued.
    #[must_use]
    pub const fn room(&self) -> usize {
        N - self.len
    }

    /// Queues a byte. Without room, the byte is dropped.
    pub fn push(&mut self, byte: u8) {
        if !self.is_full()
            && let Some(place) = self.bytes.get_mut((self.first + self.len) % N)
        {
            *place = byte;
            self.len += 1;
        }
    }

    /// Queues as many of `bytes` as there is room for, and returns how many.
    pub fn push_all(&mut self, bytes: &[u8]) -> usize {
        let bytes = bytes.get(..self.room()).unwrap_or(bytes);
        for (index, &byte) in (self.first + self.len..).zip(bytes) {
            if let Some(place) = self.bytes.get_mut(index % N) {
                *place = byte;
            }
        }
        self.len += bytes.len();
        bytes.len()
    }

    /// Moves the oldest bytes to `bytes`, as many as are queued and fit, and returns how many.
    pub fn pop_all(&mut self, bytes: &mut [u8]) -> usize {
        if self.is_empty() {
            return 0;
        }
        let count = self.len.min(bytes.len());
        for (index, byte) in (self.first..self.first + count).zip(bytes) {
            if let Some(&queued) = self.bytes.get(index % N) {
                *byte = queued;
            }
        }
        self.first = (self.first + count) % N;
        self.len -= count;
        count
    }

    /// Drops the newest bytes, so that at most `len` are left.
    pub fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    /// Takes the oldest byte; `None` if the queue is empty.
    pub fn pop(&mut self) -> Option<u8> {
        if self.is_empty() {
            return None;
        }
        let byte = self.bytes.get(self.first).copied();
        self.first = (self.first + 1) % N;
        self.len -= 1;
        byte
    }
}

impl<const N: usize> Default for ByteQueue<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    fn drain<const N: usize>(queue: &mut ByteQueue<N>) -> Vec<u8> {
        std::iter::from_fn(|| queue.pop()).collect()
    }

    /// Takes up to `count` bytes at once.
    fn pop_all<const N: usize>(queue: &mut ByteQueue<N>, count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        let taken = queue.pop_all(&mut bytes);
        bytes.truncate(taken);
        bytes
    }

    #[test]
    fn a_full_queue_drops_what_is_pushed() {
        let mut queue = ByteQueue::<4>::new();
        assert_eq!(queue.push_all(&[1, 2, 3]), 3);
        queue.push(4);
        queue.push(5);
        assert_eq!((queue.push_all(&[6]), queue.len(), queue.room()), (0, 4, 0));
        assert_eq!(drain(&mut queue), [1, 2, 3, 4]);
        assert_eq!(queue.pop(), None);
    }

    #[test]
    fn truncation_drops_the_newest_bytes() {
        let mut queue = ByteQueue::<4>::new();
        queue.push_all(&[1, 2]);
        queue.pop();
        queue.push_all(&[3, 4, 5]);
        queue.truncate(9);
        assert_eq!(queue.len(), 4);
        queue.truncate(2);
        queue.push(6);
        assert_eq!(drain(&mut queue), [2, 3, 6]);
    }

    /// Every start, fill and length of a small queue, compared with a queue of the standard library.
    #[test]
    fn it_keeps_the_order_across_the_end_of_its_array() {
        for (start, fill, count) in
            (0..8).flat_map(|s| (0..=8).flat_map(move |f| (0..=9).map(move |c| (s, f, c))))
        {
            let mut queue = ByteQueue::<8>::new();
            for _ in 0..start {
                queue.push(0xEE);
                queue.pop();
            }
            let mut model = VecDeque::new();
            for byte in 0..fill {
                queue.push(byte);
                model.push_back(byte);
            }
            let more: Vec<u8> = (100..100 + count).collect();
            let taken = queue.push_all(&more);
            model.extend(&more[..taken]);
            assert_eq!(taken, more.len().min(8 - usize::from(fill)));
            assert_eq!(
                (queue.len(), queue.is_empty(), queue.is_full()),
                (model.len(), model.is_empty(), model.len() == 8)
            );
            let oldest: Vec<u8> = model.drain(..model.len().min(usize::from(count))).collect();
            assert_eq!(
                pop_all(&mut queue, count.into()),
                oldest,
                "start {start}, fill {fill}, count {count}"
            );
            assert_eq!(drain(&mut queue), Vec::from(model), "start {start}, fill {fill}, count {count}");
        }
    }
}
