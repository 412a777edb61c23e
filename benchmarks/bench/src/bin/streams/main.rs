//! `cargo xtask bench --streams`: how evenly and with which delay set-points follow a stream of points (D23), with this
//! project's method and with others. A last table shows how the simulated arm follows a streamed sine.
//!
//! In the first tables, a joint moves at a constant velocity, and its points come in frames with jitter, losses or a pause. All
//! methods get the same frames. The seeds are fixed, so the figures are the same on every machine.

mod methods;
mod sine;

use fastrand::Rng;

use methods::{CYCLE, METHODS, Method, OURS, SetPoints};
use sine::SineTargets;

/// Degrees per second. The angle after ten minutes is still below the largest angle of motion-core.
const VELOCITY: f64 = 3.0;
/// Runs of each scenario, each with its own seed and phase of the control cycles.
const RUNS: u64 = 20;
const PERIODS: [f64; 5] = [0.005, 0.01, 0.02, 0.05, 0.1];
/// A method has settled after this many points.
const SETTLING_POINTS: usize = 40;

/// How the frames of a stream arrive.
#[derive(Clone, Copy)]
struct StreamScenario {
    name: &'static str,
    /// A frame comes up to this part of a period early or late.
    jitter: f64,
    /// The part of the frames that is lost.
    loss: f64,
    /// A pause of five periods in the middle, after which the points go on where they stopped.
    pause: bool,
    /// How much faster the host's clock runs: 200e-6 is 200 ppm.
    drift: f64,
    seconds: f64,
}

const EVEN: StreamScenario =
    StreamScenario { name: "even", jitter: 0.0, loss: 0.0, pause: false, drift: 0.0, seconds: 20.0 };

const SCENARIOS: [StreamScenario; 8] = [
    EVEN,
    StreamScenario { name: "jitter 25 %", jitter: 0.25, ..EVEN },
    StreamScenario { name: "jitter 40 %", jitter: 0.4, ..EVEN },
    StreamScenario { name: "jitter 50 %", jitter: 0.5, ..EVEN },
    StreamScenario { name: "1 % lost", loss: 0.01, ..EVEN },
    StreamScenario { name: "25 %, 1 % lost", jitter: 0.25, loss: 0.01, ..EVEN },
    StreamScenario { name: "a pause of 5 periods", pause: true, ..EVEN },
    StreamScenario {
        name: "25 %, clocks 200 ppm apart",
        jitter: 0.25,
        drift: 200e-6,
        seconds: 600.0,
        ..EVEN
    },
];

/// The figures of one run, or the worst figures of several runs.
#[derive(Clone, Copy, Default)]
struct StreamFigures {
    /// The largest deviation from the velocity of the motion, in percent.
    ripple: f64,
    /// The root of the mean square of that deviation, in percent.
    rms: f64,
    /// The mean time from the planned sending of a point until the set-point passes it, in periods.
    delay: f64,
    /// How far the set-points go past the last point, in percent of the distance between two points.
    overshoot: f64,
    /// Cycles with less than 5 % of the velocity of the motion, in percent.
    stopped: f64,
}

impl StreamFigures {
    fn worst(self, other: Self) -> Self {
        Self {
            ripple: self.ripple.max(other.ripple),
            rms: self.rms.max(other.rms),
            delay: self.delay.max(other.delay),
            overshoot: self.overshoot.max(other.overshoot),
            stopped: self.stopped.max(other.stopped),
        }
    }

    fn cells(&self) -> String {
        let Self { ripple, rms, delay, overshoot, stopped } = self;
        format!("{ripple:.1} | {rms:.1} | {delay:.2} | {stopped:.1} | {overshoot:.0}")
    }
}

fn main() {
    let columns = "largest ripple % | rms ripple % | delay P | stopped % | overshoot %";
    println!("Set-points of this firmware; the worst of {RUNS} runs.\n");
    println!("| frames | P ms | {columns} |\n| --- | --- | --- | --- | --- | --- | --- |");
    for (scenario, period) in SCENARIOS.iter().flat_map(|scenario| PERIODS.map(|period| (scenario, period))) {
        println!("| {} | {:.0} | {} |", scenario.name, period * 1e3, worst(&OURS, scenario, period).cells());
    }
    println!("\nMethods at P = 20 ms; the worst of {RUNS} runs of the same frames.\n");
    println!("| frames | method | {columns} |\n| --- | --- | --- | --- | --- | --- | --- |");
    for (scenario, method) in
        SCENARIOS.iter().flat_map(|scenario| METHODS.iter().map(move |method| (scenario, method)))
    {
        println!("| {} | {} | {} |", scenario.name, method.name, worst(method, scenario, 0.02).cells());
    }
    print_sine();
}

/// Prints how the simulated arm follows a sine.
fn print_sine() {
    println!("\nA sine of 30 degrees at 0.2 Hz, 50 points a second with 25 % jitter; joint 1.\n");
    println!("| targets | delay ms | rms error degrees | largest change of velocity, degrees/s | rms |");
    println!("| --- | --- | --- | --- | --- |");
    for (name, targets) in
        [("fine, with a period", SineTargets::Fine), ("whole degrees", SineTargets::WholeDegrees)]
    {
        let measured = sine::record(targets);
        let ((delay, error), (largest, rms)) = (sine::tracking(&measured), sine::roughness(&measured));
        println!("| {name} | {delay:.0} | {error:.3} | {largest:.1} | {rms:.1} |");
    }
}

fn worst(method: &Method, scenario: &StreamScenario, period: f64) -> StreamFigures {
    (0..RUNS)
        .map(|seed| one_run(method, scenario, period, seed))
        .fold(StreamFigures::default(), StreamFigures::worst)
}

/// A frame with one point: its arrival and its planned sending in seconds, and its angle in degrees.
struct PointFrame {
    comes: f64,
    planned: f64,
    angle: f64,
}

fn frames(scenario: &StreamScenario, period: f64, random: &mut Rng) -> Vec<PointFrame> {
    let count = (scenario.seconds / period).min(30_000.0);
    let mut frames = Vec::new();
    let mut k = 0.0;
    while k < count {
        let pause = if scenario.pause && k > count / 2.0 { 5.0 } else { 0.0 };
        let planned = 1.0 + (k + pause) * period * (1.0 - scenario.drift);
        let comes = planned + (random.f64() * 2.0 - 1.0) * scenario.jitter * period;
        if random.f64() >= scenario.loss {
            frames.push(PointFrame { comes, planned, angle: VELOCITY * (k + 1.0) * period });
        }
        k += 1.0;
    }
    frames
}

fn one_run(method: &Method, scenario: &StreamScenario, period: f64, seed: u64) -> StreamFigures {
    let mut random = Rng::with_seed(seed);
    let frames = frames(scenario, period, &mut random);
    let phase = random.f64() * CYCLE;
    let track = Track::of((method.new)(period), &frames, period, phase);
    let errors: Vec<f64> = track.velocities.iter().map(|velocity| (velocity - 1.0).abs()).collect();
    let squares: Vec<f64> = errors.iter().map(|error| error * error).collect();
    let still: Vec<f64> = track.velocities.iter().map(|velocity| f64::from(*velocity < 0.05)).collect();
    StreamFigures {
        ripple: 100.0 * errors.iter().copied().fold(0.0, f64::max),
        rms: 100.0 * mean(&squares).sqrt(),
        delay: mean(&track.delays) / period,
        overshoot: 100.0 * track.overshoot.max(0.0) / (VELOCITY * period),
        stopped: 100.0 * mean(&still),
    }
}

/// The motion of the set-points of one run, after the method had settled.
#[derive(Default)]
struct Track {
    /// The velocity in each control cycle between the points, as a part of the velocity of the motion.
    velocities: Vec<f64>,
    /// The time from the planned sending of each point until the set-point passed it, in seconds.
    delays: Vec<f64>,
    /// How far the set-points went past the last point, in degrees.
    overshoot: f64,
}

impl Track {
    fn of(mut set_points: Box<dyn SetPoints>, frames: &[PointFrame], period: f64, phase: f64) -> Self {
        let mut track = Self::default();
        let settled = frames.get(SETTLING_POINTS..).unwrap_or_default();
        let (Some(first), Some(last)) = (settled.first(), settled.last()) else { return track };
        let (mut waiting, mut passed) = (frames.iter().peekable(), settled.iter().peekable());
        let (mut now, mut before) = (phase, 0.0);
        while now < last.comes + 1.0 {
            while let Some(frame) = waiting.next_if(|frame| frame.comes <= now) {
                set_points.point(frame.comes, frame.angle, VELOCITY);
            }
            let angle = set_points.step(now);
            while let Some(frame) = passed.next_if(|frame| frame.angle <= angle + 1e-9) {
                // The set-point passed the point between the last two cycles.
                let part = ((angle - frame.angle) / (angle - before).max(1e-9)).clamp(0.0, 1.0);
                track.delays.push(now - part * CYCLE - frame.planned);
            }
            if before >= first.angle && angle < last.angle - VELOCITY * period {
                track.velocities.push((angle - before) / CYCLE / VELOCITY);
            }
            track.overshoot = track.overshoot.max(angle - last.angle);
            (now, before) = (now + CYCLE, angle);
        }
        track
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / f64::from(u32::try_from(values.len()).unwrap_or(u32::MAX)).max(1.0)
}
