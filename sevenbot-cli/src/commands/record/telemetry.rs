//! Reads targets, velocities and loads during a recording: once for each report, or less often on a slow line. Reads the health
//! at most once a second. The poses come from the reports.

use std::time::{Duration, Instant};

use recording_formats::{JointMotion, Telemetry};
use sevenbot::fine::FineState;
use sevenbot::map::{FINE_TARGET, LOAD};
use sevenbot::{Angle, Arm, Error, FineAngle, Health, Snapshot, Span};

/// Targets, positions, velocities and loads.
const REGISTERS: Span = Span::between(&FINE_TARGET, &LOAD);
/// Bits of a question and its answer on the line: 7 bytes for each frame and one for each value, at ten bits a byte.
const BITS: u32 = 10 * (7 + 7 + REGISTERS.count() as u32);
/// Reads of targets, velocities and loads use the line for at most 1 / `SHARE_OF_LINE` of the time.
const SHARE_OF_LINE: u32 = 2;
/// The shortest time between two reads of the health, which has more registers.
const HEALTH_PERIOD: Duration = Duration::from_secs(1);
/// A read of the health takes at most as long on the line as this many reads of the telemetry.
const ANSWERS_PER_HEALTH: u32 = 4;

/// Reads targets, velocities and loads, and the health at most once a second.
pub(crate) struct TelemetryReader {
    /// Do the motors follow the targets?
    is_driven: bool,
    /// Does the arm have hundredths, velocities and loads?
    is_fine: bool,
    /// The shortest time between two reads; 0 if the line is fast enough for one read per report.
    period: Duration,
    next: Instant,
    health_period: Duration,
    next_health: Instant,
}

impl TelemetryReader {
    /// `reports` is the period of the reports. `is_fine`: the arm has hundredths, velocities and loads.
    pub(crate) fn new(arm: &Arm, baud: u32, reports: Duration, is_driven: bool, is_fine: bool) -> Self {
        let answer = Duration::from_secs(1) * BITS / baud.max(1);
        let period = answer * SHARE_OF_LINE;
        Self {
            is_driven,
            is_fine,
            period: if period <= reports { Duration::ZERO } else { period },
            next: arm.now(),
            health_period: HEALTH_PERIOD.max(period * ANSWERS_PER_HEALTH),
            next_health: arm.now(),
        }
    }

    /// Reads the telemetry; empty if the next read is not due yet, as on a slow line.
    pub(crate) fn read(&mut self, arm: &mut Arm) -> Result<Telemetry, Error> {
        let now = arm.now();
        if now < self.next {
            return Ok(Telemetry::default());
        }
        self.next = now + self.period;
        let (targets, motion) = match self.is_fine {
            true => fine(&arm.read_span(REGISTERS)?),
            false => (arm.targets()?.map(FineAngle::from), None),
        };
        Ok(Telemetry { targets: self.is_driven.then_some(targets), motion })
    }

    /// Reads the health once a second, or less often on a slow line; `None` if it is not due.
    pub(crate) fn health(&mut self, arm: &mut Arm) -> Result<Option<Health>, Error> {
        let now = arm.now();
        if now < self.next_health {
            return Ok(None);
        }
        self.next_health = now + self.health_period;
        arm.health().map(Some)
    }
}

fn fine(registers: &Snapshot) -> ([FineAngle; 7], Option<JointMotion>) {
    let nearest = |word: u16| FineAngle::from_hundredths(word.min(FineAngle::MAX_HUNDREDTHS));
    let targets =
        registers.words(&FINE_TARGET).map(|word| nearest(word).unwrap_or(Angle::from_register(0).into()));
    let state = FineState::new(registers);
    let tenths = |values: [i16; 7]| values.map(|value| f64::from(value) / 10.0);
    (targets, Some(JointMotion { velocities: tenths(state.velocities), loads: tenths(state.loads) }))
}
