//! Does the arm tell the truth about itself? The status block, the positions, the reports, the valve.
//!
//! Asks four times a second of virtual time. What takes time to be true, or to be found out, gets it: the
//! bounds are stated here.

use motion_core::Vacuum;
use motion_core::calibration::angle_from_counts;
use motion_core::report_timer::highest_frequency;
use protocol_core::registers::map::{
    FAULTS, FRAMES_CORRUPTED, MISSING_SERVOS, MOVING_JOINTS, OFFSET, PRESENT_POSITION, SERVO_BUS_ERRORS,
    SERVO_TEMPERATURE, SPEED, SUPPLY_VOLTAGE, TARGET_POSITION, TIME, fault,
};
use protocol_core::registers::{Joint, Register, RegisterFile};
use protocol_core::time::{Duration, Instant};

use super::commands::{Commands, target_counts};
use super::model::Model;
use super::servos::{Health, Servos};
use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// Between two audits.
pub(super) const EVERY: Duration = Duration::from_millis(250);
/// A servo that falls silent is flagged, and one that is back is found, within this time: with all others
/// silent as well, and a start in between.
const FOUND_OUT: Duration = Duration::from_millis(2_500);
/// A joint that may not be driven is without torque after this.
const RELEASED: Duration = Duration::from_millis(300);
/// Past the time a move takes by its speed.
const PATIENCE: Duration = Duration::from_millis(1_000);
/// How long the valve may be open (D20).
const VALVE: Duration = Duration::from_millis(501);

/// What was seen of an arm since its start.
#[derive(Debug)]
pub(super) struct Audit {
    pub(super) next_at: Instant,
    /// When the shell was last late by much, or the arm started.
    unsettled_at: Instant,
    /// When something was last written that moves joints.
    motion_at: Instant,
    /// When the motor state was last written.
    state_at: Instant,
    /// By when each joint has to be where it goes.
    settled_by: PerJoint<Instant>,
    /// Where each joint was when it last moved, and when.
    moved: PerJoint<(u16, Instant)>,
    missing: u8,
    corrupted: u16,
    bus_errors: u16,
    /// Was the host's line disturbed since the start?
    pub(super) line_was_disturbed: bool,
    /// Headers in malformed requests, each of which may count as a damaged frame once.
    pub(super) false_headers: u16,
    reports: Reports,
    valve_open_since: Option<Instant>,
}

/// The reports since their frequency was last written.
#[derive(Clone, Copy, Debug)]
struct Reports {
    frequency: u32,
    since: Instant,
    count: u64,
    /// Something held some of them up.
    disturbed: bool,
}

/// What there is to look at.
pub(super) struct Sight<'a> {
    pub(super) now: Instant,
    pub(super) arm: &'a RegisterFile,
    pub(super) model: &'a Model,
    pub(super) servos: &'a Servos,
    pub(super) commands: &'a Commands,
}

fn counter(arm: &RegisterFile, row: &Register) -> u16 {
    u16::from_le_bytes([arm.get(row.address), arm.get(row.address.wrapping_add(1))])
}

impl Audit {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            next_at: now + EVERY,
            unsettled_at: now,
            motion_at: now,
            state_at: now,
            settled_by: PerJoint::all(now),
            moved: PerJoint::all((0, now)),
            missing: 0,
            corrupted: 0,
            bus_errors: 0,
            line_was_disturbed: false,
            false_headers: 0,
            reports: Reports { frequency: 0, since: now, count: 0, disturbed: false },
            valve_open_since: None,
        }
    }

    /// The shell was late until `now`.
    pub(super) fn shell_was_late(&mut self, now: Instant, by: Duration) {
        self.unsettled_at = now;
        self.reports.disturbed = true;
        self.settled_by.0.iter_mut().for_each(|at| *at = *at + by + Duration::from_millis(20));
        self.valve_open_since = self.valve_open_since.map(|since| since + by);
    }

    /// No room for reports.
    pub(super) const fn link_is_busy(&mut self) {
        self.reports.disturbed = true;
    }

    pub(super) fn vacuum(&mut self, now: Instant, vacuum: Vacuum) -> Check {
        ensure(!(vacuum.pump && vacuum.valve), || "the pump runs with the valve open".to_owned())?;
        self.valve_open_since = vacuum.valve.then_some(now);
        Ok(())
    }

    /// Suck or release was asked for: a release opens the valve for its full time, open or not.
    pub(super) fn vacuum_written(&mut self, now: Instant) {
        self.valve_open_since = self.valve_open_since.map(|_| now);
    }

    /// A write with an effect on the frequency was carried out.
    pub(super) fn frequency_written(&mut self, now: Instant, frequency: u8, baud: u32) {
        let frequency = u32::from(frequency).min(highest_frequency(baud));
        if frequency == self.reports.frequency {
            return;
        }
        self.reports = Reports { frequency, since: now, count: 0, disturbed: false };
    }

    pub(super) fn report(&mut self, now: Instant) -> Check {
        self.reports.count += 1;
        let Reports { frequency, since, count, .. } = self.reports;
        let due = (now - since).as_micros() * u64::from(frequency) / 1_000_000;
        ensure(count <= due + 1, || format!("{count} reports, and {due} are due, at {frequency} Hz"))
    }

    /// Something that moves joints was written, or a servo came back: by when all are to be still again.
    pub(super) fn motion_changed(&mut self, sight: &Sight<'_>) {
        self.motion_at = sight.now;
        for joint in Joint::ALL {
            let time = time_for(joint, way(joint, sight), sight.arm);
            self.settled_by[joint] = sight.now + time + PATIENCE;
        }
    }

    pub(super) const fn state_written(&mut self, now: Instant) {
        self.state_at = now;
    }

    /// Offsets changed: registers show it after the next measurement.
    pub(super) fn places_are_renamed(&mut self, now: Instant) {
        self.moved.0.iter_mut().for_each(|(_, since)| *since = now);
    }

    /// Servos that were flagged, or are no longer: (gone, back).
    pub(super) fn missing_changed(&mut self, arm: &RegisterFile) -> Option<(u8, u8)> {
        let missing = arm.get(MISSING_SERVOS.address);
        let before = std::mem::replace(&mut self.missing, missing);
        (before != missing).then_some((missing & !before, before & !missing))
    }

    /// Looks at everything.
    pub(super) fn look(&mut self, sight: &Sight<'_>) -> Check {
        self.next_at = sight.now + EVERY;
        for joint in Joint::ALL {
            self.look_at_joint(joint, sight)?;
        }
        self.look_at_faults(sight)?;
        self.look_at_counters(sight)?;
        self.look_at_reports(sight.now)?;
        let open = self.valve_open_since.map_or(Duration::ZERO, |since| sight.now - since);
        ensure(open <= VALVE, || format!("the valve has been open for {} us", open.as_micros()))
    }

    /// How long everything has been as it is, for a servo that has been so since `then`.
    fn settled(&self, now: Instant, then: Instant) -> Duration {
        now - then.max(self.unsettled_at)
    }

    fn is_well(&self, joint: Joint, sight: &Sight<'_>) -> bool {
        matches!(sight.servos.health(joint), Health::Well(since) if self.settled(sight.now, since) > FOUND_OUT)
    }

    fn look_at_joint(&mut self, joint: Joint, sight: &Sight<'_>) -> Check {
        let (number, now) = (joint.number(), sight.now);
        let is_missing = sight.arm.get(MISSING_SERVOS.address) & joint.bit() != 0;
        let is_moving = sight.arm.get(MOVING_JOINTS.address) & joint.bit() != 0;
        match sight.servos.health(joint) {
            Health::Silent(since) if self.settled(now, since) > FOUND_OUT => {
                ensure(is_missing, || format!("servo {number} is silent and not flagged"))?;
            }
            Health::Well(since) if self.settled(now, since) > FOUND_OUT => {
                ensure(!is_missing, || format!("servo {number} is well and flagged as missing"))?;
                self.look_at_present(joint, sight)?;
                self.look_at_torque(joint, sight)?;
            }
            _ => {}
        }
        let is_late = is_moving && now > self.settled_by[joint];
        ensure(!is_late, || format!("joint {number} has been moving for too long"))?;
        ensure(!(is_moving && is_missing), || format!("joint {number} moves and is missing"))?;
        let is_free = sight.model.is_servo() || !sight.commands.is_on(joint);
        ensure(is_free || self.settled(now, self.state_at) < RELEASED, || {
            format!("joint {number} is still driven")
        })
    }

    /// A joint at rest is where its register says.
    fn look_at_present(&mut self, joint: Joint, sight: &Sight<'_>) -> Check {
        let place = sight.servos.position(joint);
        let (last, since) = self.moved[joint];
        if last != place {
            self.moved[joint] = (place, sight.now);
        }
        // Between two looks a joint may have gone and come back, if somebody told it to.
        if last != place || self.settled(sight.now, since.max(self.motion_at)) < FOUND_OUT {
            return Ok(());
        }
        let offset = OFFSET.range.decode(sight.arm.get(OFFSET.of(joint)));
        let angle = angle_from_counts(joint, place, i8::try_from(offset).unwrap_or(0)).nearest_degree();
        let shown = sight.arm.get(PRESENT_POSITION.of(joint));
        ensure(shown.abs_diff(angle) == 0, || {
            format!("joint {} is at {angle} degrees, and its register says {shown}", joint.number())
        })
    }

    /// A servo that answers is driven, where joints are to be.
    fn look_at_torque(&self, joint: Joint, sight: &Sight<'_>) -> Check {
        let is_due = sight.model.is_servo() && self.settled(sight.now, self.state_at) > FOUND_OUT;
        let is_on = sight.commands.is_on(joint);
        ensure(is_on || !is_due, || format!("servo {} is well and not driven", joint.number()))
    }

    fn look_at_faults(&self, sight: &Sight<'_>) -> Check {
        let faults = sight.arm.get(FAULTS.address);
        let is_flagged = faults & fault::SERVO_BUS != 0;
        let is_missing = sight.arm.get(MISSING_SERVOS.address) != 0;
        ensure(is_flagged || !is_missing, || "a servo is missing, and there is no fault".to_owned())?;
        if !Joint::ALL.into_iter().all(|joint| self.is_well(joint, sight)) {
            return Ok(());
        }
        let said = || Joint::ALL.into_iter().map(|joint| sight.servos.said(joint));
        let has_alarm = said().any(|said| said.alarms != 0);
        ensure(is_flagged == has_alarm, || {
            format!("faults are {faults:#b}, a servo complains: {has_alarm}")
        })?;
        let hottest = said().map(|said| said.celsius).max().unwrap_or(0);
        let shown = sight.arm.get(SERVO_TEMPERATURE.address);
        ensure(shown.abs_diff(hottest) <= 1, || format!("{hottest} degrees Celsius, and {shown} is shown"))?;
        let supply = sight.arm.get(SUPPLY_VOLTAGE.address);
        let is_right = said().any(|said| said.decivolts.abs_diff(supply) <= 1);
        ensure(is_right, || format!("no servo says that its supply is {supply}"))
    }

    /// Counters only rise, and stand still while there is nothing to count.
    fn look_at_counters(&mut self, sight: &Sight<'_>) -> Check {
        let corrupted = counter(sight.arm, &FRAMES_CORRUPTED);
        let more = corrupted.wrapping_sub(std::mem::replace(&mut self.corrupted, corrupted));
        ensure(more < 0x8000, || format!("{more} damaged frames since the last look"))?;
        ensure(more <= self.false_headers || self.line_was_disturbed, || {
            format!("{more} damaged frames on a quiet line, {} at most", self.false_headers)
        })?;
        self.false_headers = self.false_headers.saturating_sub(more);
        let errors = counter(sight.arm, &SERVO_BUS_ERRORS);
        let more = errors.wrapping_sub(std::mem::replace(&mut self.bus_errors, errors));
        ensure(more < 0x8000, || format!("{more} servo bus errors since the last look"))?;
        let all_well = Joint::ALL.into_iter().all(|joint| self.is_well(joint, sight));
        ensure(more == 0 || !all_well, || format!("{more} servo bus errors, and all servos are well"))
    }

    fn look_at_reports(&self, now: Instant) -> Check {
        let Reports { frequency, since, count, disturbed } = self.reports;
        let due = (now - since).as_micros() * u64::from(frequency) / 1_000_000;
        ensure(disturbed || count + 2 >= due, || {
            format!("{count} reports, and {due} are due, at {frequency} Hz")
        })
    }
}

/// How far a joint may have to go, in counts.
fn way(joint: Joint, sight: &Sight<'_>) -> u16 {
    let target = target_counts(joint, sight.arm);
    match sight.commands.goal(joint) {
        // At the end of its servo a joint's set-point may be beyond.
        Some(goal @ 1..1_023) if (1..1_023).contains(&target) => goal.abs_diff(target) + 5,
        _ => 1_100,
    }
}

/// How long a joint may take for a way of so many counts.
fn time_for(joint: Joint, way: u16, arm: &RegisterFile) -> Duration {
    let degrees = u64::from(way) * 180 / if joint.number() < 5 { 850 } else { 625 } + 2;
    let speed = u64::from(arm.get(SPEED.of(joint)));
    let at_speed = |tenths: u64| Duration::from_millis(degrees * 10_000 / tenths);
    match speed {
        // The time register counts as it was when the target was written, so any may be in force.
        0 => at_speed(3_720).max(Duration::from_millis(u64::from(TIME_UNITS) * 100)),
        _ => at_speed(speed * 19),
    }
}

/// The most that a time register holds.
const TIME_UNITS: u8 = {
    let (_, most) = TIME.range.bounds();
    most.to_le_bytes()[0]
};

/// Does a write to these registers set joints in motion?
pub(super) fn concerns_motion(first: u8, count: usize) -> bool {
    let last = usize::from(first) + count;
    let (from, to) = (OFFSET.address, TARGET_POSITION.address + TARGET_POSITION.count);
    first < to && last > usize::from(from)
}
