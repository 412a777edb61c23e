//! Generates the requests of the host: reads and writes of all registers, at varying rates, some with corruption.

use protocol_core::registers::map::{
    DEVICE_ID, EEPROM_LOCK, FEEDBACK_FREQUENCY, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED, STATUS_VERSION,
    TARGET_POSITION, TIME, VACUUM_PUMP, motor_state,
};
use protocol_core::time::{Duration, Instant};

use super::corruption::{corrupt, noise};
use super::host_request::{HostRequest, SentStream};
use super::{extended_requests, map21_requests};
use crate::seeded_rng::SeededRng;

/// The longest pause inside a frame. From 100 ms on, the arm drops the frame.
const MAX_PAUSE: Duration = Duration::from_millis(90);

/// The first and last address of the extended block and the protection block.
const EXTENDED: (usize, usize) = (128, 199);

/// The kinds of requests that the host of a world sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct HostHabits {
    /// True if half of the writes are in map 2.1, false if none are.
    both_maps: bool,
    /// True if a quarter of the writes in map 2.2 are generated for the extended block, false if no write reaches it or the
    /// protection block.
    extended_block: bool,
    /// True if the host only reads for about half of the time.
    pauses: bool,
}

impl HostHabits {
    /// The habits in the world of a seed.
    pub(super) const fn of(seed: u64) -> Self {
        Self { both_maps: seed / 8 % 2 == 1, extended_block: seed / 16 % 4 == 3, pauses: seed / 64 % 4 == 3 }
    }
}

/// How often the host sends requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RequestRate {
    /// One every few seconds.
    Idle,
    /// A few per second.
    Steady,
    /// Many at once, a few times per second.
    Bursts,
}

/// A frame, or bytes that replace it, with pauses.
#[derive(Clone, Debug)]
pub(super) struct Transmission {
    /// The parts, and the pause before each.
    pub(super) parts: Vec<(Duration, Vec<u8>)>,
    /// The request, unless it was corrupted.
    pub(super) request: Option<HostRequest>,
}

/// The generator, with the bytes that it sent last.
#[derive(Debug)]
pub(super) struct RequestGenerator {
    rate: RequestRate,
    rate_until: Instant,
    only_reads: bool,
    pub(super) next_at: Instant,
    /// The number of corrupted transmissions in a million.
    pub(super) corrupted_per_million: u64,
    settings_per_mille: u64,
    habits: HostHabits,
    stream: SentStream,
}

impl RequestGenerator {
    pub(super) fn new(now: Instant, settings_per_mille: u64, habits: HostHabits) -> Self {
        Self {
            rate: RequestRate::Steady,
            rate_until: now,
            only_reads: false,
            next_at: now,
            corrupted_per_million: 0,
            settings_per_mille,
            habits,
            stream: SentStream::default(),
        }
    }

    /// The arm starts: it has received nothing.
    pub(super) fn reset(&mut self, now: Instant) {
        self.stream = SentStream::default();
        self.next_at = self.next_at.max(now);
    }

    /// The host only reads until this time.
    pub(super) fn only_read_until(&mut self, until: Instant) {
        (self.only_reads, self.rate_until) = (true, until);
    }

    /// The next transmissions. Sets `next_at` to the time of the next call.
    pub(super) fn next_transmissions(&mut self, now: Instant, rng: &mut SeededRng) -> Vec<Transmission> {
        if now >= self.rate_until {
            self.rate = rng.one_of(
                &[RequestRate::Idle, RequestRate::Steady, RequestRate::Steady, RequestRate::Bursts],
                RequestRate::Idle,
            );
            self.only_reads = self.habits.pauses && rng.one_in(2);
            self.rate_until = now + rng.any_scale(Duration::from_millis(500), Duration::from_millis(120_000));
        }
        let (count, pause) = match self.rate {
            RequestRate::Idle => (1, Duration::from_millis(2_500)),
            RequestRate::Steady => (1 + rng.below(2), Duration::from_millis(300)),
            RequestRate::Bursts => (1 + rng.below(20), Duration::from_millis(400)),
        };
        self.next_at = now + rng.wait(pause);
        loop {
            let transmissions: Vec<_> = (0..count).map(|_| self.transmission(rng)).collect();
            let mut stream = self.stream.clone();
            transmissions
                .iter()
                .for_each(|transmission| stream.add(&transmission.bytes(), transmission.request.is_some()));
            if !stream.has_unintended_frame() {
                stream.trim();
                self.stream = stream;
                return transmissions;
            }
        }
    }

    fn transmission(&self, rng: &mut SeededRng) -> Transmission {
        let request = self.any_request(rng);
        if self.corrupted_per_million > 0 && rng.in_a_million(self.corrupted_per_million) {
            let bytes = if rng.one_in(4) { noise(40, rng) } else { corrupt(&request.bytes(), rng) };
            return Transmission { parts: vec![(any_pause(rng), bytes)], request: None };
        }
        Transmission { parts: split(request.bytes(), rng), request: Some(request) }
    }

    fn any_request(&self, rng: &mut SeededRng) -> HostRequest {
        match () {
            () if self.only_reads || rng.one_in(2) => self.read(rng),
            () if self.habits.both_maps && rng.one_in(2) => self.write_map21(rng),
            () => {
                let (address, mut values) = match self.habits.extended_block && rng.one_in(4) {
                    true => extended_requests::write(rng),
                    false => self.write(rng),
                };
                if !self.habits.extended_block {
                    leave_out(EXTENDED, address, &mut values);
                }
                HostRequest::Write { address, values }
            }
        }
    }

    fn read(&self, rng: &mut SeededRng) -> HostRequest {
        let (address, count) = match rng.below(6) {
            0 => (STATUS_VERSION.address, 16),
            1 => (PRESENT_POSITION.address, 7),
            2 => (TARGET_POSITION.address, 7),
            3 => (0, 255),
            // Any range, one in eight with any length.
            _ => (rng.byte(), if rng.one_in(8) { rng.byte() } else { rng.up_to(20) }),
        };
        HostRequest::Read { address, count }
    }

    fn write_map21(&self, rng: &mut SeededRng) -> HostRequest {
        match () {
            () if rng.in_a_million(self.settings_per_mille * 1_000) => map21_requests::settings(rng),
            () if rng.one_in(2) => map21_requests::write(rng),
            () => map21_requests::of_map22(self.write(rng)),
        }
    }

    fn write(&self, rng: &mut SeededRng) -> (u8, Vec<u8>) {
        if rng.in_a_million(self.settings_per_mille * 1_000) {
            settings(rng)
        } else {
            match rng.below(16) {
                0..=5 => targets(rng),
                6 | 7 => per_joint(SPEED.address, 100, rng),
                8 => per_joint(TIME.address, 100, rng),
                9 | 10 => (MOTOR_STATE.address, vec![state(rng)]),
                11 => (FEEDBACK_FREQUENCY.address, vec![rng.up_to(50)]),
                12 => (VACUUM_PUMP.address, vec![rng.up_to(1)]),
                13 => pose(rng),
                14 => (rng.byte(), (0..rng.below(12)).map(|_| rng.byte()).collect()),
                _ => (rng.byte(), vec![rng.up_to(30); rng.below(256)]),
            }
        }
    }
}

impl Transmission {
    fn bytes(&self) -> Vec<u8> {
        self.parts.iter().flat_map(|(_, bytes)| bytes.iter().copied()).collect()
    }
}

/// Shortens a well-formed write that reaches these registers.
fn leave_out((from, to): (usize, usize), address: u8, values: &mut Vec<u8>) {
    let (first, end) = (usize::from(address), usize::from(address) + values.len());
    if end <= 256 && first <= to && end > from {
        values.truncate(from.saturating_sub(first));
    }
}

/// A motor state: servo twice as often as each of the others.
fn state(rng: &mut SeededRng) -> u8 {
    let states = [motor_state::DAMPING, motor_state::SERVO, motor_state::SERVO, motor_state::FORCELESS];
    rng.one_of(&states, motor_state::SERVO)
}

fn targets(rng: &mut SeededRng) -> (u8, Vec<u8>) {
    if rng.one_in(2) {
        return (TARGET_POSITION.of(rng.joint()), vec![rng.up_to(180)]);
    }
    (TARGET_POSITION.address, (0..7).map(|_| rng.up_to(180)).collect())
}

/// A value for one joint or for all.
fn per_joint(address: u8, most: u8, rng: &mut SeededRng) -> (u8, Vec<u8>) {
    let value = if rng.one_in(4) { 0 } else { rng.up_to(most) };
    if rng.one_in(2) { (address + rng.joint().index(), vec![value]) } else { (address, vec![value; 7]) }
}

/// All registers from the motor state to the targets in one frame.
fn pose(rng: &mut SeededRng) -> (u8, Vec<u8>) {
    let head = [state(rng), rng.up_to(1), rng.up_to(1)];
    let speeds = [rng.up_to(100); 7];
    let times = [rng.up_to(100); 7];
    let targets = (0..7).map(|_| rng.up_to(180));
    let values = head.into_iter().chain(speeds).chain(times).chain(targets.collect::<Vec<_>>());
    (MOTOR_STATE.address, values.collect())
}

/// A write of settings or of the lock. A few are out of range.
fn settings(rng: &mut SeededRng) -> (u8, Vec<u8>) {
    match rng.below(6) {
        0 | 1 => (EEPROM_LOCK.address, vec![u8::from(rng.one_in(6))]),
        2 => (DEVICE_ID.address, vec![rng.byte()]),
        3 => (DEVICE_ID.address, vec![rng.byte(), rng.up_to(8)]),
        4 => (OFFSET.of(rng.joint()), vec![offset(rng)]),
        _ => (OFFSET.address, (0..7).map(|_| offset(rng)).collect()),
    }
}

fn offset(rng: &mut SeededRng) -> u8 {
    let most = if rng.one_in(40) { 127 } else { 16 };
    rng.up_to(most) | rng.one_of(&[0, 0x80], 0)
}

fn any_pause(rng: &mut SeededRng) -> Duration {
    if rng.one_in(3) {
        rng.any_scale(Duration::from_micros(10), Duration::from_millis(300))
    } else {
        Duration::ZERO
    }
}

/// Splits a frame at random, with pauses inside it that the protocol permits.
fn split(bytes: Vec<u8>, rng: &mut SeededRng) -> Vec<(Duration, Vec<u8>)> {
    let mut parts = Vec::new();
    let mut rest = bytes;
    let mut pause = any_pause(rng);
    while rng.one_in(4) && rest.len() > 1 {
        let tail = rest.split_off(1 + rng.below(rest.len() - 1));
        parts.push((pause, rest));
        rest = tail;
        pause =
            if rng.one_in(2) { rng.any_scale(Duration::from_micros(10), MAX_PAUSE) } else { Duration::ZERO };
    }
    parts.push((pause, rest));
    parts
}
