//! The load of the chip while a program streams points and gets reports: the instructions of a second.
//! Only a part of this second is counted, and then scaled.
//!
//! ```text
//!   200 frames a second of seven fine targets ──▶ image ──▶ 50 reports a second of content 2
//!                                                   │▲
//!                             goals, 700 questions  ▼│ 700 answers a second
//! ```

use arm_sim::plant::Plant;
use protocol_core::registers::JOINTS;
use protocol_core::registers::map::{
    FEEDBACK_FREQUENCY, FINE_TARGET, REPORT_CONTENT, SET_POINT_PERIOD, SPEED,
};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};

use crate::budget::Figure;
use crate::run::TaskResult;
use emulator::lockstep::Lockstep;
use emulator::{frame, trace};

/// The time between two frames of targets, in milliseconds; also the set-point period.
const FRAME_MILLIS: u16 = 5;
/// The frequency of the reports, their content, and their length in bytes: 42 registers (142 to 183), and 7 bytes of the frame.
const REPORT_HZ: u8 = 50;
const CONTENT: u8 = 2;
const REPORT_BYTES: usize = 49;
/// When start-up and the first frames are over, in milliseconds.
const START_MILLIS: u64 = 700;
/// The counted part of a second, in milliseconds: twenty control cycles and ten reports.
const COUNTED_MILLIS: u64 = 200;
/// The counted parts in a second.
const PARTS: u64 = 1_000 / COUNTED_MILLIS;
/// 90 degrees in hundredths.
const MIDDLE: u16 = 9_000;
/// From one frame to the next, each joint moves by this many hundredths of a degree: 60 degrees a second.
const STEP: u16 = 30;
/// Instructions for a byte that the chip sends: its interrupt, and the check whether the loop has to run. The emulator's
/// transmitter is always empty, so that one interrupt sends up to eight bytes.
const PER_BYTE_SENT: u64 = 59 + 38;

/// The most attempts. On a busy computer the image may miss ticks, and then it sends fewer reports than it should.
const ATTEMPTS: usize = 4;

/// The load as one figure. The instructions for sent bytes are computed from the number of bytes; all others are counted.
pub(super) fn figure() -> TaskResult<Figure> {
    for _ in 0..ATTEMPTS {
        let (steps, reported) = count()?;
        // The first and the last report may be cut.
        if (reported / REPORT_BYTES) as u64 >= u64::from(REPORT_HZ) / PARTS - 1 {
            let what = "image: one second of 200 frames of 7 fine targets and 50 long reports";
            return Ok(Figure::new(what, PARTS * steps));
        }
        println!("the image sent {reported} bytes of reports in {COUNTED_MILLIS} ms: once more");
    }
    Err(format!("the image sent fewer reports in each of {ATTEMPTS} attempts").into())
}

/// Instructions and bytes of reports in the counted time.
fn count() -> TaskResult<(u64, usize)> {
    let mut plant = Plant::new(Instant::ZERO);
    plant.ignore_collisions();
    let mut image = Lockstep::start(plant)?;
    let write = |register: u8, values: &[u8]| frame(Request::Write { address: register, values });
    image.advance(at(START_MILLIS - 200))?;
    image.host_send(&write(SPEED.address, &[100; JOINTS]));
    image.host_send(&write(SET_POINT_PERIOD.address, &FRAME_MILLIS.to_le_bytes()));
    image.host_send(&write(REPORT_CONTENT.address, &[CONTENT]));
    image.host_send(&write(FEEDBACK_FREQUENCY.address, &[REPORT_HZ]));
    let (mut steps, mut reported) = (0, 0);
    for (number, millis) in
        (START_MILLIS - 100..START_MILLIS + COUNTED_MILLIS).step_by(FRAME_MILLIS.into()).enumerate()
    {
        let angle = [target(number).to_le_bytes(); JOINTS];
        image.host_send(&write(FINE_TARGET.address, angle.as_flattened()));
        let until = at(millis) + Duration::from_millis(FRAME_MILLIS.into());
        if millis < START_MILLIS {
            image.advance(until)?;
            image.take_sent()?;
        } else {
            steps += trace::steps(&image.log_until(until)?);
            let sent = image.take_sent()?;
            reported += sent.to_host;
            steps += PER_BYTE_SENT * (sent.to_host + sent.to_servos) as u64;
        }
    }
    Ok((steps, reported))
}

/// A triangle of 120 steps: from the middle up by 18 degrees, and back.
fn target(number: usize) -> u16 {
    let phase = u16::try_from(number % 120).unwrap_or(0);
    MIDDLE + STEP * phase.min(120 - phase)
}

fn at(millis: u64) -> Instant {
    Instant::from_micros(millis * 1_000)
}
