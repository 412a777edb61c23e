//! A sine on all joints, streamed to the simulated arm: as fine targets with a period, and in whole degrees. And the
//! same fine targets, streamed to the image in the emulator.
//!
//! The points come 50 times a second with 25 % jitter, at a speed register of 100. The drawing shows joint 1.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::servo_bus::ServoBus;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use fastrand::Rng;
use motion_core::calibration::angle_from_counts;
use motion_core::servo_bus::frame::{Decoder, register};
use protocol_core::registers::map::{FINE_TARGET, SET_POINT_PERIOD, SPEED, TARGET_POSITION};
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};

use crate::count::frame;
use crate::emulate::lockstep::Lockstep;
use crate::run::TaskResult;

/// Degrees and hertz.
const AMPLITUDE: f64 = 30.0;
const FREQUENCY: f64 = 0.2;
/// The middle of the sine for each joint, in degrees.
const MIDDLE: [f64; JOINTS] = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 50.0];
const PERIOD_MS: u16 = 20;
const JITTER: f64 = 0.25;
/// Seconds before the sine, and its length.
const START: f64 = 3.0;
const LENGTH: f64 = 10.0;
/// The end of a recording.
const END: f64 = START + LENGTH + 1.0;
/// Seconds between two samples of the arm.
const SAMPLE: f64 = 0.002;

/// Times in seconds and angles in degrees.
pub(super) type Curve = Vec<(f64, f64)>;

/// What happened to joint 1.
#[derive(Default)]
pub(super) struct Recording {
    pub(super) asked: Curve,
    /// The goals that its servo was sent.
    pub(super) goals: Curve,
    /// Where it was.
    pub(super) measured: Curve,
}

/// How a program sends points.
#[derive(Clone, Copy)]
pub(super) enum Targets {
    /// Registers 128 to 141, with a set-point period.
    Fine,
    /// Registers 46 to 52.
    WholeDegrees,
}

/// A servo bus that keeps the goals of joint 1.
#[derive(Debug)]
struct Recorder {
    plant: Plant,
    goals: Curve,
    /// Where joint 1 was at each poll.
    measured: Curve,
}

impl ServoBus for Recorder {
    const IS_REAL: bool = false;

    fn baud(&self) -> u32 {
        self.plant.baud()
    }

    fn answer_delay(&self) -> Duration {
        Duration::ZERO
    }

    fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        let mut decoder = Decoder::new();
        decoder.push(bytes);
        if let Some(Ok(frame)) = decoder.pull()
            && let [register::GOAL_POSITION, _, 0, high, low, ..] = frame.params
        {
            let counts = u16::from_be_bytes([*high, *low]);
            let angle = angle_from_counts(Joint::ALL[0], counts, 0);
            self.goals.push((seconds(now), f64::from(angle.0) / 1e6));
        }
        self.plant.bytes(now, bytes);
    }

    fn poll(&mut self, now: Instant) -> Vec<u8> {
        let bytes = self.plant.poll(now);
        self.measured.push((seconds(now), f64::from(self.plant.angle(Joint::ALL[0])) / 1e3));
        bytes
    }

    fn deadline(&self) -> Option<Instant> {
        self.plant.deadline()
    }

    fn power_cycle(&mut self, now: Instant) {
        self.plant.power_cycle(now);
    }
}

impl Recorder {
    fn new() -> Self {
        Self { plant: Plant::new(Instant::ZERO), goals: Vec::new(), measured: Vec::new() }
    }
}

/// Streams the sine to the emulated image, with simulated servos.
pub(super) fn record_image() -> TaskResult<Recording> {
    let mut recorder = Recorder::new();
    recorder.plant.ignore_collisions();
    let mut image = Lockstep::start(recorder)?;
    let mut recording = Recording::default();
    for (at, bytes) in frames(Targets::Fine, &mut recording.asked) {
        image.advance(instant(at))?;
        image.host_send(&bytes);
    }
    image.advance(instant(END))?;
    recording.goals = std::mem::take(&mut image.bus.goals);
    recording.measured = resampled(&image.bus.measured);
    Ok(recording)
}

/// The curve at even times, from one whose times are uneven.
fn resampled(curve: &Curve) -> Curve {
    let mut even = Curve::new();
    for pair in curve.windows(2) {
        let [(from, low), (to, high)] = *pair else { continue };
        let mut time = SAMPLE * f64::from(u32::try_from(even.len()).unwrap_or(u32::MAX));
        while time < to {
            even.push((time, low + (high - low) * (time - from).max(0.0) / (to - from)));
            time += SAMPLE;
        }
    }
    even
}

/// Streams the sine to a simulated arm.
pub(super) fn record(targets: Targets) -> Recording {
    let config = ArmConfig { chip_id: [0; 6], is_paced: true, torque_codes: Default::default() };
    let recorder = Recorder::new();
    let mut arm: SimulatedArm<Flash, Recorder> =
        SimulatedArm::power_up(Instant::ZERO, config, Flash::in_memory(), recorder);
    let mut recording = Recording::default();
    let mut frames = frames(targets, &mut recording.asked).into_iter().peekable();
    let mut time = 0.0;
    while time < END {
        while let Some((at, bytes)) = frames.next_if(|(at, _)| *at <= time) {
            arm.advance(instant(at), false);
            arm.host_send(instant(at), &bytes);
        }
        arm.advance(instant(time), false);
        let angle = f64::from(arm.bus().plant.angle(Joint::ALL[0])) / 1e3;
        recording.measured.push((time, angle));
        time += SAMPLE;
    }
    recording.goals = std::mem::take(&mut arm.bus().goals);
    recording
}

/// The frames of a program and when it sends them; adds the sine of joint 1 to `asked`.
fn frames(targets: Targets, asked: &mut Curve) -> Vec<(f64, Vec<u8>)> {
    let write = |register: u8, values: &[u8]| frame(Request::Write { address: register, values });
    let mut frames = vec![(1.0, write(SPEED.address, &[100; JOINTS]))];
    if matches!(targets, Targets::Fine) {
        frames.push((1.1, write(SET_POINT_PERIOD.address, &PERIOD_MS.to_le_bytes())));
    }
    let mut random = Rng::with_seed(1);
    let period = f64::from(PERIOD_MS) / 1e3;
    let mut planned = START;
    while planned < START + LENGTH {
        let angles = MIDDLE.map(|middle| middle + AMPLITUDE * (TAU * FREQUENCY * (planned - START)).sin());
        asked.push((planned, angles[0]));
        let bytes = match targets {
            Targets::Fine => write(
                FINE_TARGET.address,
                angles.map(|angle| whole(angle * 100.0).to_le_bytes()).as_flattened(),
            ),
            Targets::WholeDegrees => {
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

#[expect(clippy::cast_precision_loss, reason = "below 2^53")]
fn seconds(time: Instant) -> f64 {
    time.as_micros() as f64 / 1e6
}

/// Delay of the measured sine in milliseconds, and the root of the mean square of its distance from the delayed sine in
/// degrees.
pub(super) fn tracking(recording: &Recording) -> (f64, f64) {
    let error = |delay: f64| {
        let settled = recording.measured.iter().filter(|(at, _)| (START + 1.0..START + LENGTH).contains(at));
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
pub(super) fn roughness(recording: &Recording) -> (f64, f64) {
    let settled: Vec<f64> = recording
        .measured
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

/// Two panels with their titles: half a second around the steepest part of the sine.
pub(super) fn svg(panels: &[(&str, &Recording); 2]) -> String {
    let mut out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 860 640\" width=\"860\" height=\"640\">\n\
        <style>text { font: 13px sans-serif; fill: #444 } .title { font-size: 15px; fill: #111 } \
        polyline { fill: none } .asked { stroke: #f2b56b; stroke-width: 5 } \
        .goals { stroke: #3a9; stroke-width: 2 } .measured { stroke: #1b5e9e; stroke-width: 1.5 } \
        .panel { fill: #fafafa; stroke: #ddd }</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
        <text class=\"title\" x=\"20\" y=\"24\">A sine of 30° at 0.2 Hz, streamed at 50 Hz with 25 % jitter: joint 1</text>\n\
        <text x=\"20\" y=\"44\">pale: asked; green: goals of the servo; blue: measured. the panels show 0.5 s of 10 s, and 24°</text>\n"
        .to_owned();
    for (top, (title, recording)) in [60.0, 350.0].into_iter().zip(panels) {
        panel(&mut out, recording, top, title);
    }
    out.push_str("</svg>\n");
    out
}

const PANEL_HEIGHT: f64 = 260.0;

fn panel(out: &mut String, recording: &Recording, top: f64, title: &str) {
    let (from, to, low, high) = (START + 4.75, START + 5.25, 78.0, 102.0);
    let _ =
        writeln!(out, "<rect class=\"panel\" x=\"20\" y=\"{top}\" width=\"820\" height=\"{PANEL_HEIGHT}\"/>");
    let _ = writeln!(out, "<text x=\"30\" y=\"{}\">{title}</text>", top + 20.0);
    let curves =
        [("asked", &recording.asked), ("goals", &recording.goals), ("measured", &recording.measured)];
    for (class, curve) in curves {
        let inside =
            curve.iter().filter(|(at, angle)| (from..to).contains(at) && (low..high).contains(angle));
        let points: Vec<String> = inside
            .map(|(at, angle)| {
                let x = 20.0 + 820.0 * (at - from) / (to - from);
                let y = top + PANEL_HEIGHT * (high - angle) / (high - low);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        let _ = writeln!(out, "<polyline class=\"{class}\" points=\"{}\"/>", points.join(" "));
    }
}
