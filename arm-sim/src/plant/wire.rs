//! The one wire of the servo bus at 1 Mbaud: when which byte is through.
//!
//! A servo drives the line until some time after its last stop bit. A frame of the master that overlaps with
//! that is lost, and it damages the bytes of the servo that it overlaps with. Two frames of the master cannot
//! overlap: the second waits for the first. Servos that speak at once are heard one after the other, so
//! collisions between servos are not simulated. Knows nothing of what the bytes mean.

use std::collections::VecDeque;

use protocol_core::time::{Duration, Instant};

/// Time on the wire of one byte at 1 Mbaud, ten bits, in microseconds.
const BYTE_TIME_US: u64 = 10;
/// How long a servo drives the line after its last stop bit: "some microseconds" is all that is known, so this is
/// assumed.
pub(crate) const DRIVE_TIME: Duration = Duration::from_micros(20);
/// What a collision does to each byte.
const DAMAGE: u8 = 0x55;

/// Bytes that go over the wire in one go.
#[derive(Clone, Debug)]
struct Transmission {
    /// When its first byte begins, or later where the wire is taken.
    start: Instant,
    bytes: VecDeque<u8>,
    /// A servo sends it; otherwise it is the master's own echo.
    is_from_servo: bool,
}

/// What is on its way to the master.
#[derive(Clone, Debug)]
pub(crate) struct Wire {
    /// In the order of their starts.
    queue: VecDeque<Transmission>,
    /// When the last byte to the master is through.
    free_at: Instant,
    /// When the last byte from the master is through.
    master_done: Instant,
    /// Until when the servo that sent last drives the line.
    driven_until: Instant,
}

impl Wire {
    pub(crate) const fn new() -> Self {
        Self {
            queue: VecDeque::new(),
            free_at: Instant::ZERO,
            master_done: Instant::ZERO,
            driven_until: Instant::ZERO,
        }
    }

    /// The master sends so many bytes at `now`, behind what it is sending already: begin and end of it.
    pub(crate) fn master_sends(&mut self, now: Instant, count: usize) -> (Instant, Instant) {
        let begin = self.master_done.max(now);
        self.master_done = begin + time_of(count);
        (begin, self.master_done)
    }

    /// Does a frame of the master from `begin` to `end` collide with a servo? If so, what the servo still sends is
    /// damaged.
    pub(crate) fn collides(&mut self, begin: Instant, end: Instant) -> bool {
        let mut has_collided = begin < self.driven_until;
        let mut free_at = self.free_at;
        for transmission in &mut self.queue {
            let start = transmission.start.max(free_at);
            free_at = start + time_of(transmission.bytes.len());
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

    /// Plans the bytes of a servo to the master, from `start` on.
    pub(crate) fn send(&mut self, start: Instant, bytes: &[u8]) {
        self.plan(Transmission { start, bytes: bytes.iter().copied().collect(), is_from_servo: true });
    }

    /// Lets the master hear its own bytes, from `start` on; damaged, if they collided.
    pub(crate) fn echo(&mut self, start: Instant, bytes: &[u8], has_collided: bool) {
        let damage = if has_collided { DAMAGE } else { 0 };
        let bytes = bytes.iter().map(|byte| byte ^ damage).collect();
        self.plan(Transmission { start, bytes, is_from_servo: false });
    }

    fn plan(&mut self, transmission: Transmission) {
        let place = self.queue.partition_point(|earlier| earlier.start <= transmission.start);
        self.queue.insert(place, transmission);
    }

    /// Takes the bytes that are through by `now`.
    pub(crate) fn take(&mut self, now: Instant) -> Vec<u8> {
        let mut through = Vec::new();
        while let Some(first) = self.queue.front_mut() {
            let start = first.start.max(self.free_at);
            let whole_bytes = (now - start).as_micros() / BYTE_TIME_US;
            let count = usize::try_from(whole_bytes).unwrap_or(usize::MAX).min(first.bytes.len());
            through.extend(first.bytes.drain(..count));
            if count > 0 {
                self.free_at = start + time_of(count);
            }
            if !first.bytes.is_empty() {
                break;
            }
            if first.is_from_servo {
                self.driven_until = self.free_at + DRIVE_TIME;
            }
            self.queue.pop_front();
        }
        through
    }

    /// When the next answer is through to its last byte.
    pub(crate) fn deadline(&self) -> Option<Instant> {
        self.queue.front().map(|first| first.start.max(self.free_at) + time_of(first.bytes.len()))
    }

    /// Power off: nothing comes any more.
    pub(crate) fn clear(&mut self) {
        *self = Self::new();
    }
}

fn time_of(bytes: usize) -> Duration {
    Duration::from_micros(u64::try_from(bytes).unwrap_or(u64::MAX).saturating_mul(BYTE_TIME_US))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    #[test]
    fn a_byte_is_through_after_ten_microseconds() {
        let mut wire = Wire::new();
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
    fn a_taken_wire_makes_the_next_wait() {
        let mut wire = Wire::new();
        wire.send(at(110), &[3, 4]);
        wire.send(at(100), &[1, 2]);
        assert_eq!(wire.take(at(120)), [1, 2]);
        assert_eq!(wire.deadline(), Some(at(140)));
        assert_eq!(wire.take(at(139)), [3]);
        assert_eq!(wire.take(at(140)), [4]);
    }

    #[test]
    fn looked_at_late_all_of_it_is_there_in_order() {
        let mut wire = Wire::new();
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
            let mut wire = Wire::new();
            wire.send(at(100), &[1, 2]);
            if is_taken {
                assert_eq!(wire.take(at(120)), [1, 2]);
            }
            assert!(wire.collides(at(120), at(200)));
            assert!(wire.collides(at(139), at(200)));
            assert!(!wire.collides(at(140), at(200)));
            if !is_taken {
                assert_eq!(wire.take(at(120)), [1, 2], "its bytes were through before");
            }
        }
    }

    #[test]
    fn a_frame_that_meets_an_answer_damages_it() {
        for (begin, end) in [(50, 101), (105, 300), (119, 120)] {
            let mut wire = Wire::new();
            wire.send(at(100), &[1, 2]);
            assert!(!wire.collides(at(50), at(100)), "before it");
            assert!(wire.collides(at(begin), at(end)));
            assert_eq!(wire.take(at(120)), [1 ^ DAMAGE, 2 ^ DAMAGE]);
        }
    }

    #[test]
    fn the_masters_own_echo_is_no_collision() {
        let mut wire = Wire::new();
        wire.echo(at(100), &[1], false);
        assert!(!wire.collides(at(105), at(200)));
        wire.echo(at(110), &[2], true);
        assert_eq!(wire.take(at(200)), [1, 2 ^ DAMAGE]);
    }

    #[test]
    fn the_master_queues_behind_itself() {
        let mut wire = Wire::new();
        assert_eq!(wire.master_sends(at(100), 8), (at(100), at(180)));
        assert_eq!(wire.master_sends(at(110), 2), (at(180), at(200)));
        assert_eq!(wire.master_sends(at(300), 1), (at(300), at(310)));
    }
}
