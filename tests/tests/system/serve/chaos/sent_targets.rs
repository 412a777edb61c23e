//! Targets whose values encode the number of a write. From this number, the test knows when the targets were sent.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use system_tests::registers::{PRESENT_POSITION, TARGET_POSITION};
use system_tests::relay::Passing;

/// Joints whose targets hold the number of a write.
const DIGITS: u32 = 4;
/// The number of values of a target. Each target is a digit in this base.
const BASE: u64 = 100;
/// The lowest target, in degrees.
const LOWEST: u64 = 40;
/// The number of latest writes whose times are kept.
const KEPT: u64 = 1 << 20;
/// The number of joints, and the number of last positions that are kept.
const JOINTS: usize = 7;
const REMEMBERED: usize = 512;

/// The times of the last writes of targets, and the ages of those that reached the arm.
pub(crate) struct SentTargets {
    start: Instant,
    next: AtomicU64,
    /// For each write, the microseconds from `start` to the end of its sending. 0: it is being sent.
    times: Vec<AtomicU64>,
    arrived: Mutex<Vec<Duration>>,
    /// The last positions that the arm sent. A hold in whole degrees writes one of these as targets. Such a write is ignored,
    /// because it may look like targets that were sent long ago.
    positions: Mutex<VecDeque<[u8; JOINTS]>>,
}

impl SentTargets {
    pub(crate) fn new() -> Self {
        let times = (0..KEPT).map(|_| AtomicU64::new(0)).collect();
        Self {
            start: Instant::now(),
            next: AtomicU64::new(0),
            times,
            arrived: Mutex::default(),
            positions: Mutex::default(),
        }
    }

    /// Sends targets that encode a new number, and notes when they were sent.
    pub(crate) fn send<T>(&self, send: impl FnOnce([u8; DIGITS as usize]) -> T) -> T {
        let number = self.next.fetch_add(1, Ordering::SeqCst);
        let time = self.slot(number);
        time.store(0, Ordering::SeqCst);
        let outcome = send(targets(number));
        // The send may have blocked for long, so the age counts from its end.
        let sent = u64::try_from(self.start.elapsed().as_micros()).expect("a test of less than an age");
        time.store(sent.max(1), Ordering::SeqCst);
        outcome
    }

    /// Notes the targets or the positions in a frame on the arm's line.
    pub(crate) fn note(&self, passing: Passing<'_>) {
        match passing {
            Passing::Request([_, _, 4 | 6, TARGET_POSITION, _, values @ ..]) => self.reached(values),
            Passing::Reply([_, _, 3, address, _, values @ ..]) => self.note_positions(*address, values),
            _ => {}
        }
    }

    fn note_positions(&self, address: u8, values: &[u8]) {
        let place = PRESENT_POSITION.checked_sub(address).map(usize::from);
        let Some(&found) = place.and_then(|place| values.get(place..)?.first_chunk()) else { return };
        let mut positions = self.positions.lock().expect("no panic");
        positions.push_back(found);
        if positions.len() > REMEMBERED {
            positions.pop_front();
        }
    }

    /// Notes the age of targets that have reached the arm.
    fn reached(&self, values: &[u8]) {
        let is_hold = |all: &[u8; JOINTS]| self.positions.lock().expect("no panic").contains(all);
        if values.first_chunk().is_some_and(is_hold) {
            return;
        }
        let Some(number) = number(values) else { return };
        let newer = self.next.load(Ordering::SeqCst).checked_sub(number);
        assert!(
            newer.is_some_and(|newer| newer < KEPT),
            "the target {number} was not sent of late: {values:?}"
        );
        let sent = self.slot(number).load(Ordering::SeqCst);
        let age = match sent {
            0 => Duration::ZERO,
            sent => self.start.elapsed().saturating_sub(Duration::from_micros(sent)),
        };
        self.arrived.lock().expect("no panic").push(age);
    }

    /// The time from sending to arrival of each write of targets that reached the arm, in ascending order, and the number of
    /// writes sent.
    pub(crate) fn ages(&self) -> (Vec<Duration>, u64) {
        let mut ages = self.arrived.lock().expect("no panic").clone();
        ages.sort_unstable();
        (ages, self.next.load(Ordering::SeqCst))
    }

    fn slot(&self, number: u64) -> &AtomicU64 {
        &self.times[usize::try_from(number % KEPT).expect("small")]
    }
}

fn targets(number: u64) -> [u8; DIGITS as usize] {
    std::array::from_fn(|digit| {
        let power = BASE.pow(u32::try_from(digit).expect("small"));
        u8::try_from(LOWEST + number / power % BASE).expect("a target")
    })
}

/// The number in targets; `None` if they hold none.
fn number(targets: &[u8]) -> Option<u64> {
    (0..DIGITS).try_fold(0, |number, digit| {
        let target = u64::from(*targets.get(usize::try_from(digit).ok()?)?);
        let value = target.checked_sub(LOWEST).filter(|&value| value < BASE)?;
        Some(number + value * BASE.pow(digit))
    })
}

#[test]
fn a_number_passes_through_targets() {
    for wanted in [0, 7, 99, 100, 123_456, 99_999_999] {
        assert_eq!(number(&targets(wanted)), Some(wanted));
    }
    assert_eq!(number(&[90, 90, 65]), None);
}
