//! Checks the status block, the positions, the reports and the valve against the true state of the arm, four times a
//! second of virtual time.
//!
//! The constants below state how long the arm may take until its status is right.

use motion_core::Vacuum;
use motion_core::calibration::angle_from_counts;
use motion_core::servo_bus::frame::error;
use protocol_core::registers::map::{
    FAULTS, FRAMES_CORRUPTED, MISSING_SERVOS, MOVING_JOINTS, OFFSET, PRESENT_POSITION, SERVO_BUS_ERRORS,
    SERVO_TEMPERATURE, SPEED, SUPPLY_VOLTAGE, TIME, fault, limit,
};
use protocol_core::registers::map21::WRIST_POSITION;
use protocol_core::registers::{Joint, Register, RegisterFile};
use protocol_core::time::{Duration, Instant};

use super::command_checker::{CommandChecker, target_counts};
use super::disturbed_bus::{Availability, DisturbedBus};
use super::extended_model::{self, LIMITS};
use super::protection_model::PROTECTION;
use super::register_model::RegisterModel;
use super::report_checker::ReportChecker;
use super::watchdog_model::WatchdogModel;
use crate::per_joint::PerJoint;
use crate::violation::{Check, ensure};

/// The time between two checks.
pub(super) const CHECK_PERIOD: Duration = Duration::from_millis(250);
/// A position that was not checked for longer may have changed meanwhile: two checks.
const UNCHECKED_TIME: Duration = Duration::from_millis(500);
/// A lost or found servo is reported within this time, even after a restart and with all other servos silent.
const DETECTION_TIME: Duration = Duration::from_millis(2_500);
/// Torque is off this long after a change to another motor state than servo.
const RELEASE_TIME: Duration = Duration::from_millis(300);
/// The time that a move may take beyond its distance at its speed.
const MOVE_MARGIN: Duration = Duration::from_millis(1_000);
/// A point of a stream is reached after two periods and a cycle (D23), of the longest period.
const MAX_STREAM_MILLIS: u64 = 2_020;
/// The time of a move over the whole range at the lowest speed, 1.9 degrees/s.
const LONGEST_MOVE: Duration = Duration::from_millis(125_000);
/// A servo that was too hot gets torque again when it is 5 degrees cooler (D28). Its limit is 80 degrees Celsius.
const COOL: u8 = 75;
/// The longest time that the valve may be open (D20).
const MAX_VALVE_TIME: Duration = Duration::from_millis(501);

/// The observed state of an arm since its start.
#[derive(Debug)]
pub(super) struct StatusChecker {
    pub(super) next_at: Instant,
    /// The last start of the arm or end of a stall of the shell.
    unsettled_at: Instant,
    /// The last write that can move joints.
    motion_at: Instant,
    /// The last write of the motor state.
    state_at: Instant,
    /// The time by which each joint has to be at rest.
    settled_by: PerJoint<Instant>,
    /// The last position of each joint, and the time of its last change.
    last_moves: PerJoint<(u16, Instant)>,
    /// When the position of each joint was checked last.
    position_checked_at: PerJoint<Instant>,
    /// The last time at which a joint that is let go had no latched overload.
    unlatched_at: PerJoint<Instant>,
    missing: u8,
    corrupted: u16,
    bus_errors: u16,
    /// True if the host link was disturbed since the start.
    pub(super) link_was_disturbed: bool,
    /// Headers in malformed requests. The arm may count each of them as a corrupted frame once.
    pub(super) false_headers: u16,
    pub(super) reports: ReportChecker,
    valve_open_since: Option<Instant>,
}

/// The true state of the arm, and its registers.
pub(super) struct StatusContext<'a> {
    pub(super) now: Instant,
    pub(super) registers: &'a RegisterFile,
    pub(super) model: &'a RegisterModel,
    pub(super) watchdog: &'a WatchdogModel,
    pub(super) bus: &'a DisturbedBus,
    pub(super) command_checker: &'a CommandChecker,
}

impl StatusContext<'_> {
    /// True if a joint need not go on with its move: it gives way, it is let go, or some questions are not answered.
    fn may_be_late(&self, joint: Joint) -> bool {
        self.bus.truth(joint).may_give_way(self.now)
            || self.bus.may_be_let_go(joint, self.now)
            || self.bus.availability(joint) == Availability::Uncertain
            || self.now - self.command_checker.paused_at[joint] < MOVE_MARGIN
    }
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

    /// The shell stalls until `now`, for a time of `by`.
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

    /// The pump register was written: a release opens the valve for the full time, even if it is open already.
    pub(super) fn vacuum_written(&mut self, now: Instant) {
        self.valve_open_since = self.valve_open_since.map(|_| now);
    }

    /// A write can move joints, or a servo was found: computes the time by which each joint has to be at rest.
    pub(super) fn motion_changed(&mut self, context: &StatusContext<'_>) {
        self.motion_at = context.now;
        for joint in Joint::ALL {
            let time = move_time(joint, distance(joint, context), context.registers);
            self.settled_by[joint] = context.now + time + MOVE_MARGIN + in_stream(context.model);
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

    /// Checks the whole status.
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

    /// The time since the last stall, start, and the time `then`.
    fn settled_time(&self, now: Instant, then: Instant) -> Duration {
        now - then.max(self.unsettled_at)
    }

    fn is_responding(&self, joint: Joint, context: &StatusContext<'_>) -> bool {
        matches!(context.bus.availability(joint), Availability::Responding(since) if self.settled_time(context.now, since) > DETECTION_TIME)
    }

    fn check_joint(&mut self, joint: Joint, context: &StatusContext<'_>) -> Check {
        let (number, now) = (joint.number(), context.now);
        let is_missing = context.registers.get(MISSING_SERVOS.address) & joint.bit() != 0;
        let is_moving = context.registers.get(MOVING_JOINTS.address) & joint.bit() != 0;
        match context.bus.availability(joint) {
            Availability::Silent(since) if self.settled_time(now, since) > DETECTION_TIME => {
                ensure(is_missing, || format!("servo {number} is silent and not reported as missing"))?;
            }
            Availability::Responding(since) if self.settled_time(now, since) > DETECTION_TIME => {
                ensure(!is_missing, || format!("servo {number} responds and is reported as missing"))?;
                self.check_position(joint, context)?;
                self.check_torque(joint, context)?;
            }
            _ => {}
        }
        self.check_latch(joint, context)?;
        // A joint of the linkage may wait for the other one (D25), even for one whose servo is missing.
        let may_wait = context.model.get(LIMITS) & limit::LINKAGE != 0 && matches!(joint.number(), 2 | 3);
        if may_wait {
            // It has its full time once the limit is off.
            self.settled_by[joint] = self.settled_by[joint].max(now + LONGEST_MOVE);
        }
        if context.may_be_late(joint) {
            let time = move_time(joint, WHOLE_RANGE, context.registers);
            let settled_by = now + time + MOVE_MARGIN + in_stream(context.model);
            self.settled_by[joint] = self.settled_by[joint].max(settled_by);
        }
        let is_late = is_moving && now > self.settled_by[joint];
        ensure(!is_late, || format!("joint {number} has been moving for too long"))?;
        ensure(!(is_moving && is_missing), || format!("joint {number} is reported as moving and missing"))?;
        let is_free = context.model.is_servo() || !context.command_checker.is_on(joint);
        ensure(is_free || self.settled_time(now, self.state_at) < RELEASE_TIME, || {
            format!("joint {number} still has torque")
        })
    }

    /// Checks the positions of the extended block, which the arm has just shown (D21).
    pub(super) fn check_fine_positions(&self, context: &StatusContext<'_>) -> Check {
        extended_model::check_positions(context.registers)?;
        for joint in Joint::ALL.into_iter().filter(|joint| self.is_responding(*joint, context)) {
            let (position, since) = self.last_moves[joint];
            let at_rest = self.settled_time(context.now, since.max(self.motion_at));
            if position == context.bus.position(joint) && at_rest >= DETECTION_TIME {
                let offset = context.model.offset(joint);
                // Since its last reading a joint that meets an obstacle may have moved by a count.
                let read =
                    context.command_checker.measured(joint).filter(|read| read.abs_diff(position) <= 1);
                let shown = read.unwrap_or(position);
                extended_model::check_position(joint, shown, offset, context.registers)?;
            }
        }
        Ok(())
    }

    /// The position register of a joint at rest holds its position.
    fn check_position(&mut self, joint: Joint, context: &StatusContext<'_>) -> Check {
        let position = context.bus.position(joint);
        let (last, since) = self.last_moves[joint];
        let checked_at = std::mem::replace(&mut self.position_checked_at[joint], context.now);
        // While it was not checked, the joint may have moved away and back.
        let may_have_moved = last != position || context.now - checked_at > UNCHECKED_TIME;
        if may_have_moved {
            self.last_moves[joint] = (position, context.now);
        }
        // So it may after a write.
        if may_have_moved || self.settled_time(context.now, since.max(self.motion_at)) < DETECTION_TIME {
            return Ok(());
        }
        let angle = angle_from_counts(joint, position, context.model.offset(joint)).nearest_degree();
        let shown = context.registers.get(PRESENT_POSITION.of(joint));
        ensure(shown.abs_diff(angle) == 0, || {
            format!("joint {} is at {angle} degrees, and its register holds {shown}", joint.number())
        })
    }

    /// A joint that is let go gets torque-off, which ends a latched overload (D28).
    fn check_latch(&mut self, joint: Joint, context: &StatusContext<'_>) -> Check {
        // Register 196 is as old as its last read. A joint that gets no goals at all is let go.
        let is_let_go = context.now - context.command_checker.goal_at[joint] > CHECK_PERIOD;
        let is_due = is_let_go
            && context.model.is_servo()
            && context.model.get(PROTECTION) == 1
            && self.is_responding(joint, context);
        if !is_due || context.bus.last_status(joint).alarms & error::OVERLOAD == 0 {
            self.unlatched_at[joint] = context.now;
        }
        ensure(context.now - self.unlatched_at[joint] < DETECTION_TIME, || {
            format!("joint {} is let go, and its overload stays latched", joint.number())
        })
    }

    /// A servo that responds has torque in motor state servo.
    fn check_torque(&self, joint: Joint, context: &StatusContext<'_>) -> Check {
        let is_due =
            context.model.is_servo() && self.settled_time(context.now, self.state_at) > DETECTION_TIME;
        let is_on = context.command_checker.is_on(joint);
        let all_respond = || Joint::ALL.into_iter().all(|other| self.is_responding(other, context));
        let may_wait = context.bus.truth(joint).may_wait_for_torque(context.now)
            || context.command_checker.is_exhausted(joint)
            || (context.command_checker.is_undecided() && !all_respond())
            || context.bus.may_be_misread(joint, context.now)
            || context.bus.last_status(joint).alarms != 0
            || context.bus.last_status(joint).celsius > COOL
            || context.model.get(PROTECTION) == 0;
        ensure(is_on || may_wait || !is_due, || {
            format!("servo {} responds and has no torque", joint.number())
        })
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

    /// Counters only increase, and do not change without an error.
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

/// More than the whole range of a joint, in counts.
const WHOLE_RANGE: u16 = 1_100;

/// The time by which a point of a stream may be late.
fn in_stream(model: &RegisterModel) -> Duration {
    Duration::from_millis(if model.has_streams() { MAX_STREAM_MILLIS } else { 0 })
}

/// The largest distance that a joint may have to move, in counts.
fn distance(joint: Joint, context: &StatusContext<'_>) -> u16 {
    let target = target_counts(joint, context.registers, context.model);
    match context.command_checker.goal(joint) {
        // A set-point may lie beyond the end of the servo's range.
        Some(goal @ 1..1_023) if (1..1_023).contains(&target) => goal.abs_diff(target) + 5,
        _ => WHOLE_RANGE,
    }
}

/// The time that a joint may take for this distance in counts.
fn move_time(joint: Joint, distance: u16, registers: &RegisterFile) -> Duration {
    let degrees = u64::from(distance) * 180 / if joint.number() < 5 { 850 } else { 625 } + 2;
    let speed = u64::from(registers.get(SPEED.of(joint)));
    let at_speed = |tenths: u64| Duration::from_millis(degrees * 10_000 / tenths);
    match speed {
        // The time register applies as it was when the target was written, so assume the largest time.
        0 => at_speed(3_720).max(Duration::from_millis(u64::from(MAX_TIME_UNITS) * 100)),
        _ => at_speed(speed * 19),
    }
}

/// The largest value of a time register.
const MAX_TIME_UNITS: u8 = {
    let (_, most) = TIME.range.bounds();
    most.to_le_bytes()[0]
};

/// True if a write to these registers, in any map, can move joints.
pub(super) fn affects_motion(first: u8, count: usize) -> bool {
    let last = usize::from(first) + count;
    let (from, to) = (OFFSET.address, WRIST_POSITION.address + WRIST_POSITION.count);
    let is_extended =
        first <= extended_model::REPORT_CONTENT && last > usize::from(extended_model::FINE_TARGETS.0);
    (first < to && last > usize::from(from)) || is_extended
}
