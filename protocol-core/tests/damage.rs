//! A million good frames between damage of every kind: how many are lost, and how late the rest come (D3, D4).
//!
//! The line runs at 115 200 baud. Damage is followed by a burst of good frames, then silence. A frame is
//! late by the time from its own last byte to its coming out.

#![allow(clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // A panic is a failed test.

mod stream;

use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, ToArm};
use stream::{Event, GAP_US, Random, Received, drain, frame};

const FRAMES: usize = 1_000_000;
/// "At most five in a million": what is left is noise that completes to a right checksum by chance.
const MOST_LOST: usize = 5;
const BYTE_US: u64 = 87;
const BURST: usize = 4;

/// What one scenario came to.
struct Tally {
    lost: usize,
    /// Longest wait, less what was still to come of the burst, in microseconds.
    worst_delay_us: u64,
}

/// A frame like any other. Victims of damage have odd addresses and the rest even ones, so that a victim that
/// comes out after all is not mistaken for another frame.
fn any_frame(random: &mut Random, victim: bool) -> Vec<u8> {
    let data: Vec<u8> = (0..random.below(20)).map(|_| random.byte()).collect();
    let address = u8::try_from(random.below(110)).unwrap() * 2 + u8::from(victim);
    frame(if random.below(2) == 0 { 3 } else { 6 }, address, &data)
}

/// Runs `FRAMES` good frames through a deframer, each burst of them behind what `damage` makes of a frame.
fn run(name: &str, seed: u64, mut damage: impl FnMut(&mut Random, Vec<u8>) -> Vec<Event>) -> Tally {
    let mut random = Random::new(seed);
    let mut deframer = Deframer::<ToArm>::new(Duration::from_micros(GAP_US));
    let mut now = 0;
    let mut tally = Tally { lost: 0, worst_delay_us: 0 };
    let mut received = Vec::new();
    for _ in 0..FRAMES / BURST {
        let victim = any_frame(&mut random, true);
        let mut line = damage(&mut random, victim);
        let sent: Vec<Vec<u8>> = (0..BURST).map(|_| any_frame(&mut random, false)).collect();
        line.extend(sent.iter().cloned().map(Event::Bytes));
        line.extend([Event::Silence(GAP_US), Event::Silence(20_000)]);
        let burst_us: u64 = sent.iter().map(|bytes| bytes.len() as u64 * BYTE_US).sum();
        // When the last byte of each good frame came, and when it came out.
        let mut ends = Vec::new();
        let mut waiting = sent.as_slice();
        let first_good = line.len() - BURST - 2;
        for (index, event) in line.iter().enumerate() {
            match event {
                Event::Silence(micros) => {
                    now += micros;
                    deframer.push(Instant::from_micros(now), &[]);
                    drain(&mut deframer, &mut received);
                }
                Event::Bytes(bytes) => {
                    for byte in bytes {
                        now += BYTE_US;
                        deframer.push(Instant::from_micros(now), &[*byte]);
                        drain(&mut deframer, &mut received);
                    }
                    if index >= first_good {
                        ends.push(now);
                    }
                }
            }
            for said in received.drain(..) {
                let Received::Frame(bytes) = said else { continue };
                // Damage may let the victim through: it is not among those that wait.
                let done = BURST - waiting.len();
                if let Some(place) = waiting.iter().position(|expected| *expected == bytes)
                    && let Some(end) = ends.get(done + place)
                {
                    tally.lost += place;
                    tally.worst_delay_us = tally.worst_delay_us.max((now - end).saturating_sub(burst_us));
                    waiting = &waiting[place + 1..];
                }
            }
        }
        tally.lost += waiting.len();
    }
    println!(
        "{name}: {} of {FRAMES} lost, worst delay past the burst {} us (seed {seed})",
        tally.lost, tally.worst_delay_us
    );
    tally
}

fn check(name: &str, damage: impl FnMut(&mut Random, Vec<u8>) -> Vec<Event>) {
    let tally = run(name, 7, damage);
    assert!(tally.lost <= MOST_LOST, "{name}: {} lost", tally.lost);
    assert!(tally.worst_delay_us <= GAP_US, "{name}: {} us late", tally.worst_delay_us);
}

#[test]
fn d03_noise() {
    check("noise", |random, _| {
        let likely = [0xAA, 0x77, 0xAA, 0x77, 0x06, 0x03];
        let noise = (0..=random.below(40))
            .map(|_| if random.below(2) == 0 { likely[random.below(likely.len())] } else { random.byte() });
        vec![Event::Bytes(noise.collect())]
    });
}

#[test]
fn d03_truncated_frame() {
    check("truncated frame", |random, victim| {
        let length = random.below(victim.len());
        vec![Event::Bytes(victim[..length].to_vec())]
    });
}

#[test]
fn d03_flipped_bit() {
    check("flipped bit", |random, mut victim| {
        let place = random.below(victim.len());
        victim[place] ^= 1 << random.below(8);
        vec![Event::Bytes(victim)]
    });
}

#[test]
fn d03_lost_byte() {
    check("lost byte", |random, mut victim| {
        victim.remove(random.below(victim.len()));
        vec![Event::Bytes(victim)]
    });
}

#[test]
fn d03_doubled_byte() {
    check("doubled byte", |random, mut victim| {
        let place = random.below(victim.len());
        victim.insert(place, victim[place]);
        vec![Event::Bytes(victim)]
    });
}

#[test]
fn d04_false_long_header() {
    check("false long header", |random, _| {
        let count = 200 + random.below(56);
        vec![Event::Bytes(vec![0xAA, 0x77, 6, random.byte(), u8::try_from(count).unwrap()])]
    });
}

#[test]
fn d04_pause_of_5_ms_inside_a_good_frame() {
    // The frame with the pause is undamaged too: it has to come out as well.
    let mut paused = 0;
    let mut random = Random::new(11);
    let mut deframer = Deframer::<ToArm>::new(Duration::from_micros(GAP_US));
    let (mut now, mut received, mut lost) = (0, Vec::new(), 0);
    for _ in 0..FRAMES {
        let bytes = any_frame(&mut random, false);
        let (head, tail) = bytes.split_at(random.below(bytes.len()));
        for part in [head, tail] {
            deframer.push(Instant::from_micros(now), part);
            drain(&mut deframer, &mut received);
            now += 5_000;
            deframer.push(Instant::from_micros(now), &[]);
            drain(&mut deframer, &mut received);
        }
        paused += 1;
        lost += usize::from(!received.drain(..).any(|said| said == Received::Frame(bytes.clone())));
    }
    println!("pause inside a frame: {lost} of {paused} lost (seed 11)");
    assert_eq!(lost, 0);
}
