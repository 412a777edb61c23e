//! The wire of the servo bus: when each byte arrives.
//!
//! A servo drives the line until some time after its last stop bit. A frame of the master that overlaps with this time is
//! lost. If it overlaps with bytes of the servo, it damages all of the servo's bytes that have not arrived yet. Two frames of
//! the master cannot overlap: the second one waits for the first. Servos that send at the same time are received one after
//! the other, so collisions between servos are not simulated. This module does not interpret the bytes.

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::mem;

use motion_core::servo_bus::ByteTime;
use protocol_core::time::{Duration, Instant};

/// How long a servo drives the line after its last stop bit. The datasheet says "some microseconds", so this is
/// assumed.
pub(crate) const DRIVE_TIME: Duration = Duration::from_micros(20);
/// A collision changes these bits of each byte.
const DAMAGE: u8 = 0x55;

/// Bytes without a pause between them.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct FrameOnWire {
    /// The start of the first byte, if the wire is free by then.
    start: Instant,
    bytes: Vec<u8>,
    /// Number of bytes that have arrived.
    arrived: usize,
    /// The sender is a servo; otherwise this is the echo of the master.
    is_from_servo: bool,
}

/// The bytes to the master that have not arrived.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Wire {
    /// In bits per second.
    baud: u32,
    byte_time: ByteTime,
    /// Ordered by start.
    queue: VecDeque<FrameOnWire>,
    /// The bytes that the last call of [`Wire::take`] returned.
    arrived: Vec<u8>,
    /// The buffer of an earlier transmission, which the next one reuses.
    spare: Vec<u8>,
    /// The end of the last byte to the master.
    free_at: Instant,
    /// The end of the last byte from the master.
    master_done_at: Instant,
    /// The servo that sent last drives the line until this time.
    driven_until: Instant,
}

impl Wire {
    /// A free wire at `baud` bits per second.
    pub(crate) const fn at_baud(baud: u32) -> Self {
        Self {
            baud,
            byte_time: ByteTime::at_baud(baud),
            queue: VecDeque::new(),
            arrived: Vec::new(),
            spare: Vec::new(),
            free_at: Instant::ZERO,
            master_done_at: Instant::ZERO,
            driven_until: Instant::ZERO,
        }
    }

    /// The baud rate, in bits per second.
    pub(crate) const fn baud(&self) -> u32 {
        self.baud
    }

    /// Reserves the wire for this many bytes of the master, from `now` or from the end of its earlier bytes on. Returns start and
    /// end.
    pub(crate) fn reserve(&mut self, now: Instant, count: usize) -> (Instant, Instant) {
        let start = self.master_done_at.max(now);
        self.master_done_at = start + self.byte_time.of(count);
        (start, self.master_done_at)
    }

    /// Returns whether bytes of the master from `begin` to `end` collide with a servo. If they overlap with the servo's bytes,
    /// this damages the servo's bytes that have not arrived yet.
    pub(crate) fn collide(&mut self, begin: Instant, end: Instant) -> bool {
        let mut has_collided = begin < self.driven_until;
        let mut free_at = self.free_at;
        for transmission in &mut self.queue {
            let start = transmission.start.max(free_at);
            free_at = start + self.byte_time.of(transmission.bytes.len() - transmission.arrived);
            if !transmission.is_from_servo || start >= end || begin >= free_at + DRIVE_TIME {
                continue;
            }
            has_collided = true;
            if begin < free_at {
                transmission.bytes.iter_mut().for_each(|byte| *byte ^= DAMAGE);
            }
        }
        has_collided
    }

    /// Lets a servo send bytes from `start` on.
    pub(crate) fn send(&mut self, start: Instant, bytes: &[u8]) {
        self.insert(start, bytes.iter().copied(), true);
    }

    /// Lets the master receive its own bytes from `start` on. Damages them if they collided.
    pub(crate) fn echo(&mut self, start: Instant, bytes: &[u8], has_collided: bool) {
        let damage = if has_collided { DAMAGE } else { 0 };
        self.insert(start, bytes.iter().map(|byte| byte ^ damage), false);
    }

    fn insert(&mut self, start: Instant, content: impl Iterator<Item = u8>, is_from_servo: bool) {
        let mut bytes = mem::take(&mut self.spare);
        bytes.clear();
        bytes.extend(content);
        let transmission = FrameOnWire { start, bytes, arrived: 0, is_from_servo };
        if self.queue.back().is_none_or(|last| last.start <= start) {
            self.queue.push_back(transmission);
        } else {
            let index = self.queue.partition_point(|earlier| earlier.start <= start);
            self.queue.insert(index, transmission);
        }
    }

    /// Takes the bytes that have arrived by `now`.
    #[inline]
    pub(crate) fn take(&mut self, now: Instant) -> &[u8] {
        self.arrived.clear();
        if !self.queue.is_empty() {
            self.arrive(now);
        }
        &self.arrived
    }

    #[inline(never)]
    fn arrive(&mut self, now: Instant) {
        while let Some(first) = self.queue.front_mut() {
            let start = first.start.max(self.free_at);
            let whole_bytes = self.byte_time.count_within(now - start);
            let left = first.bytes.get(first.arrived..).unwrap_or(&[]);
            let count = usize::try_from(whole_bytes).unwrap_or(usize::MAX).min(left.len());
            if count > 0 {
                self.free_at = start + self.byte_time.of(count);
            }
            self.arrived.extend_from_slice(left.get(..count).unwrap_or(left));
            if count < left.len() {
                first.arrived += count;
                break;
            }
            if first.is_from_servo {
                self.driven_until = self.free_at + DRIVE_TIME;
            }
            self.spare = self.queue.pop_front().map_or(Vec::new(), |last| last.bytes);
        }
    }

    /// When the last byte of the next transmission arrives.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        let first = self.queue.front()?;
        Some(first.start.max(self.free_at) + self.byte_time.of(first.bytes.len() - first.arrived))
    }

    /// Drops all bytes, as without power.
    pub(crate) fn clear(&mut self) {
        *self = Self::at_baud(self.baud);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn wire() -> Wire {
        Wire::at_baud(1_000_000)
    }

    #[test]
    fn a_byte_arrives_after_ten_microseconds() {
        let mut wire = wire();
        wire.send(at(100), &[1, 2, 3]);
        assert_eq!(wire.deadline(), Some(at(130)));
        assert_eq!(wire.take(at(0)), []);
        assert_eq!(wire.take(at(109)), []);
        assert_eq!(wire.take(at(110)), [1]);
        assert_eq!(wire.take(at(119)), []);
        assert_eq!(wire.deadline(), Some(at(130)));
        assert_eq!(wire.take(at(130)), [2, 3]);
        assert_eq!(wire.deadline(), None);
        assert_eq!(wire.take(at(999)), []);
    }

    #[test]
    fn a_slower_wire_takes_longer() {
        let mut wire = Wire::at_baud(115_200);
        wire.send(at(0), &[7; 57]);
        assert_eq!(wire.deadline(), Some(at(4_949)), "57 bytes of 86.8 us");
        assert_eq!((wire.take(at(86)).len(), wire.take(at(87)).len()), (0, 1));
        wire.clear();
        assert_eq!(wire.baud(), 115_200);
    }

    #[test]
    fn a_transmission_waits_until_the_wire_is_free() {
        let mut wire = wire();
        wire.send(at(110), &[3, 4]);
        wire.send(at(100), &[1, 2]);
        assert_eq!(wire.take(at(120)), [1, 2]);
        assert_eq!(wire.deadline(), Some(at(140)));
        assert_eq!(wire.take(at(139)), [3]);
        assert_eq!(wire.take(at(140)), [4]);
    }

    #[test]
    fn a_late_call_takes_all_bytes_in_order() {
        let mut wire = wire();
        wire.send(at(500), &[5]);
        wire.send(at(110), &[3, 4]);
        wire.send(at(100), &[1, 2]);
        assert_eq!(wire.take(at(10_000)), [1, 2, 3, 4, 5]);
        wire.send(at(9_000), &[6]);
        assert_eq!(wire.take(at(10_000)), [6]);
    }

    #[test]
    fn a_servo_drives_the_line_for_20_us_after_its_last_byte() {
        for is_taken in [false, true] {
            let mut wire = wire();
            wire.send(at(100), &[1, 2]);
            if is_taken {
                assert_eq!(wire.take(at(120)), [1, 2]);
            }
            assert!(wire.collide(at(120), at(200)));
            assert!(wire.collide(at(139), at(200)));
            assert!(!wire.collide(at(140), at(200)));
            if !is_taken {
                assert_eq!(wire.take(at(120)), [1, 2], "its bytes had arrived before");
            }
        }
    }

    #[test]
    fn a_frame_that_overlaps_with_an_answer_damages_it() {
        for (begin, end) in [(50, 101), (105, 300), (119, 120)] {
            let mut wire = wire();
            wire.send(at(100), &[1, 2]);
            assert!(!wire.collide(at(50), at(100)), "before it");
            assert!(wire.collide(at(begin), at(end)));
            assert_eq!(wire.take(at(120)), [1 ^ DAMAGE, 2 ^ DAMAGE]);
        }
    }

    #[test]
    fn the_echo_of_the_master_is_no_collision() {
        let mut wire = wire();
        wire.echo(at(100), &[1], false);
        assert!(!wire.collide(at(105), at(200)));
        wire.echo(at(110), &[2], true);
        assert_eq!(wire.take(at(200)), [1, 2 ^ DAMAGE]);
    }

    #[test]
    fn a_frame_of_the_master_waits_for_the_one_before() {
        let mut wire = wire();
        assert_eq!(wire.reserve(at(100), 8), (at(100), at(180)));
        assert_eq!(wire.reserve(at(110), 2), (at(180), at(200)));
        assert_eq!(wire.reserve(at(300), 1), (at(300), at(310)));
    }
}
