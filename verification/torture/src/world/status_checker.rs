//! Checks the status block, the positions, the torque, the reports, the watchdog and the valve against the true state of the
//! arm, four times a second of virtual time.
//!
//! The constants below state how long the arm may take until its status is right.

mod context;
mod joint_status;
mod move_time;

use motion_core::Vacuum;
use protocol_core::registers::map::{
    FAULTS, FRAMES_CORRUPTED, MISSING_SERVOS, SERVO_BUS_ERRORS, SERVO_TEMPERATURE, SUPPLY_VOLTAGE, fault,
};
use protocol_core::registers::{Joint, Register, RegisterFile};
use protocol_core::time::{Duration, Instant};

use super::disturbed_bus::Availability;
use super::report_checker::ReportChecker;
use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};
pub(super) use context::StatusContext;
pub(super) use move_time::affects_motion;
use move_time::{distance, rest_by};

pub(super) const CHECK_PERIOD: Duration = Duration::from_millis(250);
/// A lost or found servo is reported within this time, even after a restart and with all other servos silent.
const DETECTION_TIME: Duration = Duration::from_millis(2_500);
/// The longest time that the valve may be open (D20).
const MAX_VALVE_TIME: Duration = Duration::from_millis(501);

/// The observed state of an arm since its start.
#[derive(Debug)]
pub(super) struct StatusChecker {
    pub(super) next_at: Instant,
    /// The last start of the arm or end of a stall of the shell.
    unsettled_at: Instant,
    /// The last write that can move joints, or the last time that a servo was found.
    motion_at: Instant,
    /// The last write of the motor state, or the last time that the arm entered state 0 by itself.
    state_at: Instant,
    /// The time by which each joint has to be at rest.
    settled_by: PerJoint<Instant>,
    /// The last position of each joint, and the time of its last change.
    last_moves: PerJoint<(u16, Instant)>,
    /// When the position of each joint was checked last.
    position_checked_at: PerJoint<Instant>,
    /// The last time at which each joint was not let go, or had no latched overload.
    unlatched_at: PerJoint<Instant>,
    missing: u8,
    corrupted: u16,
    bus_errors: u16,
    /// True if the host link was disturbed since the start.
    pub(super) link_was_disturbed: bool,
    /// Headers in malformed requests that the arm has not counted yet. It may count each as a corrupted frame once.
    pub(super) false_headers: u16,
    pub(super) reports: ReportChecker,
    valve_open_since: Option<Instant>,
}

fn counter(registers: &RegisterFile, row: &Register) -> u16 {
    u16::from_le_bytes([registers.get(row.address), registers.get(row.address.wrapping_add(1))])
}

impl StatusChecker {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            next_at: now + CHECK_PERIOD,
            unsettled_at: now,
            motion_at: now,
            state_at: now,
            settled_by: PerJoint::all(now),
            last_moves: PerJoint::all((0, now)),
            position_checked_at: PerJoint::all(now),
            unlatched_at: PerJoint::all(now),
            missing: 0,
            corrupted: 0,
            bus_errors: 0,
            link_was_disturbed: false,
            false_headers: 0,
            reports: ReportChecker::new(now),
            valve_open_since: None,
        }
    }

    /// True if the arm has run without a stall for so long that it knows its servos.
    pub(super) fn is_settled(&self, now: Instant) -> bool {
        now - self.unsettled_at > DETECTION_TIME
    }

    /// The shell stalls for the time `by`, which ends at `now`.
    pub(super) fn shell_was_late(&mut self, now: Instant, by: Duration) {
        self.unsettled_at = now;
        self.reports.disturb();
        self.settled_by.0.iter_mut().for_each(|at| *at = *at + by + Duration::from_millis(20));
        self.valve_open_since = self.valve_open_since.map(|since| since + by);
    }

    pub(super) fn vacuum_switched(&mut self, now: Instant, vacuum: Vacuum) -> Check {
        ensure(!(vacuum.pump && vacuum.valve), || "the pump runs with the valve open".to_owned())?;
        self.valve_open_since = vacuum.valve.then_some(now);
        Ok(())
    }

    /// The pump register was written: the time of an open valve begins anew, because a suction and a release may come in one poll.
    pub(super) fn vacuum_written(&mut self, now: Instant) {
        self.valve_open_since = self.valve_open_since.map(|_| now);
    }

    /// A write can move joints, or a servo was found: computes the time by which each joint has to be at rest.
    pub(super) fn motion_changed(&mut self, context: &StatusContext<'_>) {
        self.motion_at = context.now;
        for joint in Joint::ALL {
            let goal = context.command_checker.goal(joint);
            let distance = distance(goal, context.model.target_counts(joint, context.registers));
            self.settled_by[joint] = rest_by(context.now, joint, distance, context.registers, context.model);
        }
    }

    pub(super) const fn state_written(&mut self, now: Instant) {
        self.state_at = now;
    }

    /// Offsets changed: the positions change with the next reading.
    pub(super) fn offsets_changed(&mut self, now: Instant) {
        self.last_moves.0.iter_mut().for_each(|(_, since)| *since = now);
    }

    /// The servos that are newly reported as missing, and those that no longer are; `None` if nothing changed.
    pub(super) fn missing_changed(&mut self, registers: &RegisterFile) -> Option<(u8, u8)> {
        let missing = registers.get(MISSING_SERVOS.address);
        let before = std::mem::replace(&mut self.missing, missing);
        (before != missing).then_some((missing & !before, before & !missing))
    }

    pub(super) fn check(&mut self, context: &StatusContext<'_>) -> Check {
        self.next_at = context.now + CHECK_PERIOD;
        for joint in Joint::ALL {
            self.check_joint(joint, context)?;
        }
        self.check_faults(context)?;
        self.check_counters(context)?;
        self.reports.check(context.now)?;
        let own = |joint: &Joint| context.may_be_late(*joint);
        let own = Joint::ALL.into_iter().filter(own).fold(0, |bits, joint| bits | joint.bit());
        context.watchdog.check(context.now, self.unsettled_at, own, context.registers)?;
        let open = self.valve_open_since.map_or(Duration::ZERO, |since| context.now - since);
        ensure(open <= MAX_VALVE_TIME, || format!("the valve has been open for {} us", open.as_micros()))
    }

    /// The time since the latest of three times: the start, the end of the last stall, and `then`.
    fn settled_time(&self, now: Instant, then: Instant) -> Duration {
        now - then.max(self.unsettled_at)
    }

    fn is_responding(&self, joint: Joint, context: &StatusContext<'_>) -> bool {
        matches!(context.bus.availability(joint), Availability::Responding(since) if self.settled_time(context.now, since) > DETECTION_TIME)
    }

    fn check_faults(&self, context: &StatusContext<'_>) -> Check {
        let faults = context.registers.get(FAULTS.address);
        let is_flagged = faults & fault::SERVO_BUS != 0;
        let is_missing = context.registers.get(MISSING_SERVOS.address) != 0;
        ensure(is_flagged || !is_missing, || "a missing servo without the servo bus fault".to_owned())?;
        if !Joint::ALL.into_iter().all(|joint| self.is_responding(joint, context)) {
            return Ok(());
        }
        let status = || Joint::ALL.into_iter().map(|joint| context.bus.last_status(joint));
        let has_alarm = status().any(|status| status.alarms != 0);
        ensure(is_flagged == has_alarm, || {
            format!("the faults are {faults:#b}, with an alarm of a servo: {has_alarm}")
        })?;
        let hottest = status().map(|status| status.celsius).max().unwrap_or(0);
        let shown = context.registers.get(SERVO_TEMPERATURE.address);
        ensure(shown.abs_diff(hottest) <= 1, || format!("{shown} degrees Celsius instead of {hottest}"))?;
        let supply = context.registers.get(SUPPLY_VOLTAGE.address);
        let is_right = status().any(|status| status.decivolts.abs_diff(supply) <= 1);
        ensure(is_right, || format!("no servo measured the supply {supply}"))
    }

    /// Checks that counters only increase, and do not change without an error.
    fn check_counters(&mut self, context: &StatusContext<'_>) -> Check {
        let corrupted = counter(context.registers, &FRAMES_CORRUPTED);
        let more = corrupted.wrapping_sub(std::mem::replace(&mut self.corrupted, corrupted));
        ensure(more < 0x8000, || format!("{more} more corrupted frames in one check period"))?;
        ensure(more <= self.false_headers || self.link_was_disturbed, || {
            format!("{more} corrupted frames on an undisturbed link, at most {}", self.false_headers)
        })?;
        self.false_headers = self.false_headers.saturating_sub(more);
        let errors = counter(context.registers, &SERVO_BUS_ERRORS);
        let more = errors.wrapping_sub(std::mem::replace(&mut self.bus_errors, errors));
        ensure(more < 0x8000, || format!("{more} more servo bus errors in one check period"))?;
        let all_well = Joint::ALL.into_iter().all(|joint| self.is_responding(joint, context));
        ensure(more == 0 || !all_well, || format!("{more} servo bus errors while all servos respond"))
    }
}
