//! A sine on all joints, streamed to the simulated arm: as fine targets with a period, and in whole degrees.
//!
//! The points come 50 times a second with 25 % jitter, at a speed register of 100. Joint 1 is measured.

use std::f64::consts::TAU;

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use fastrand::Rng;
use protocol_core::registers::map::{FINE_TARGET, SET_POINT_PERIOD, SPEED, TARGET_POSITION};
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::request::Request;
use protocol_core::time::Instant;
use protocol_core::wire::FrameBuffer;

/// The sine: its amplitude in degrees, and its frequency in hertz.
const AMPLITUDE: f64 = 30.0;
const FREQUENCY: f64 = 0.2;
/// The middle of the sine for each joint, in degrees.
const MIDDLE: [f64; JOINTS] = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 50.0];
const PERIOD_MS: u16 = 20;
const JITTER: f64 = 0.25;
/// Seconds before the sine, and its length.
const START: f64 = 3.0;
const LENGTH: f64 = 10.0;
/// The end of a recording, in seconds.
const END: f64 = START + LENGTH + 1.0;
/// Seconds between two samples of the arm.
const SAMPLE: f64 = 0.002;

/// Times in seconds and angles in degrees.
pub(super) type Curve = Vec<(f64, f64)>;

/// How a program sends points.
#[derive(Clone, Copy)]
pub(super) enum SineTargets {
    /// Registers 128 to 141, with a set-point period.
    Fine,
    /// Registers 46 to 52.
    WholeDegrees,
}

/// Streams the sine to a simulated arm.
pub(super) fn record(targets: SineTargets) -> Curve {
    let config = ArmConfig { chip_id: [0; 6], is_paced: true, torque_codes: Default::default() };
    let plant = Plant::new(Instant::ZERO);
    let mut arm: SimulatedArm<Flash, Plant> =
        SimulatedArm::power_up(Instant::ZERO, config, Flash::in_memory(), plant);
    let mut measured = Curve::new();
    let mut frames = frames(targets).into_iter().peekable();
    let mut time = 0.0;
    while time < END {
        while let Some((at, bytes)) = frames.next_if(|(at, _)| *at <= time) {
            arm.advance(instant(at), false);
            arm.host_send(instant(at), &bytes);
        }
        arm.advance(instant(time), false);
        measured.push((time, f64::from(arm.bus().angle(Joint::ALL[0])) / 1e3));
        time += SAMPLE;
    }
    measured
}

/// The frames of a program and when it sends them.
fn frames(targets: SineTargets) -> Vec<(f64, Vec<u8>)> {
    let write = |register: u8, values: &[u8]| frame(Request::Write { address: register, values });
    let mut frames = vec![(1.0, write(SPEED.address, &[100; JOINTS]))];
    if matches!(targets, SineTargets::Fine) {
        frames.push((1.1, write(SET_POINT_PERIOD.address, &PERIOD_MS.to_le_bytes())));
    }
    let mut random = Rng::with_seed(1);
    let period = f64::from(PERIOD_MS) / 1e3;
    let mut planned = START;
    while planned < START + LENGTH {
        let angles = MIDDLE.map(|middle| middle + AMPLITUDE * (TAU * FREQUENCY * (planned - START)).sin());
        let bytes = match targets {
            SineTargets::Fine => write(
                FINE_TARGET.address,
                angles.map(|angle| whole(angle * 100.0).to_le_bytes()).as_flattened(),
            ),
            SineTargets::WholeDegrees => {
                write(TARGET_POSITION.address, &angles.map(|angle| whole(angle).to_le_bytes()[0]))
            }
        };
        frames.push((planned + (random.f64() * 2.0 - 1.0) * JITTER * period, bytes));
        planned += period;
    }
    frames
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 18000")]
fn whole(number: f64) -> u16 {
    number.round() as u16
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive, below 2^53")]
fn instant(seconds: f64) -> Instant {
    Instant::from_micros((seconds * 1e6).round() as u64)
}

/// Delay of the measured sine in milliseconds, and the root of the mean square of its distance from the delayed sine in
/// degrees.
pub(super) fn tracking(measured: &Curve) -> (f64, f64) {
    let error = |delay: f64| {
        let settled = measured.iter().filter(|(at, _)| (START + 1.0..START + LENGTH).contains(at));
        let squares: Vec<f64> = settled
            .map(|(at, angle)| angle - MIDDLE[0] - AMPLITUDE * (TAU * FREQUENCY * (at - START - delay)).sin())
            .map(|error| error * error)
            .collect();
        (squares.iter().sum::<f64>() / f64::from(u32::try_from(squares.len().max(1)).unwrap_or(1))).sqrt()
    };
    let candidates = (0..300).map(|millis| f64::from(millis) / 1e3);
    let best = candidates.map(|delay| (delay * 1e3, error(delay)));
    best.fold((0.0, f64::INFINITY), |best, found| if found.1 < best.1 { found } else { best })
}

/// Largest change of the measured velocity between two control cycles, and its root mean square, in degrees per second.
pub(super) fn roughness(measured: &Curve) -> (f64, f64) {
    let settled: Vec<f64> = measured
        .iter()
        .filter(|(at, _)| (START + 1.0..START + LENGTH).contains(at))
        .step_by(5)
        .map(|(_, angle)| *angle)
        .collect();
    let velocities: Vec<f64> = differences(&settled).map(|step| step / 0.01).collect();
    let changes: Vec<f64> = differences(&velocities).map(f64::abs).collect();
    let mean = changes.iter().map(|change| change * change).sum::<f64>()
        / f64::from(u32::try_from(changes.len().max(1)).unwrap_or(1));
    (changes.iter().copied().fold(0.0, f64::max), mean.sqrt())
}

fn differences(values: &[f64]) -> impl Iterator<Item = f64> {
    values.iter().skip(1).zip(values).map(|(after, before)| after - before)
}

fn frame(request: Request<'_>) -> Vec<u8> {
    let mut buffer = FrameBuffer::new();
    request.encode(&mut buffer);
    buffer.to_vec()
}
