//! Moves a servo slowly to the middle of its range, and stops at an obstacle.
//!
//! The goal becomes the present position before the torque goes on, so the servo does not jump.

use std::time::Duration;

use motion_core::servo_bus::Reading;
use motion_core::servo_bus::frame::{error, register};

use super::bus_master::BusMaster;
use super::error::ServoError;
use super::servo_info::{ServoInfo, error_words};

/// The middle of the range of 0 to 1023 counts.
pub const MIDDLE: u16 = 511;
/// A servo this near to its goal has arrived: its dead zone is 2 counts on either side.
const ARRIVED_COUNTS: u16 = 4;
/// The torque switch: code 1 is on in both of Feetech's tables.
const TORQUE_ON: [u8; 1] = [1];
/// Code 0 is damping in Feetech's older table, and free in the current one. In both the motor does not drive.
const TORQUE_OFF: [u8; 1] = [0];
/// The number of registers from the present position to the moving flag.
const MEASURED: u8 = register::MOVING - register::PRESENT_POSITION + 1;
/// This many consecutive readings above the load limit end the move. A single one may come from the start of the motion.
const OVERLOAD_READINGS: u32 = 5;

/// Speed and limits of the move.
#[derive(Clone, Copy, Debug)]
pub struct CenterOptions {
    /// Speed in counts per second.
    pub speed: u16,
    /// The load that ends the move, in 0.1 % of the stall torque.
    pub load: u16,
    /// Time between two readings.
    pub poll_period: Duration,
    /// After this time without progress the servo is blocked.
    pub stall: Duration,
}

impl Default for CenterOptions {
    fn default() -> Self {
        Self { speed: 100, load: 600, poll_period: Duration::from_millis(20), stall: Duration::from_secs(3) }
    }
}

/// Why a servo is not in the middle. A move that ends early switches the torque off.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CenterError {
    /// The position limits exclude the middle, or the servo has none. Nothing was written.
    #[error("{}", out_of_reach(*limits))]
    OutOfReach {
        /// Lowest and highest position, in counts.
        limits: (u16, u16),
    },
    /// The servo reports errors. Nothing was written.
    #[error("the servo reports: {}", error_words(*errors))]
    ReportsErrors {
        /// The error bits, as [`error_words`] names them.
        errors: u8,
    },
    /// The servo reports a position outside 0 to 1023 counts.
    #[error("the servo reports no position between 0 and 1023 counts")]
    Unmeasured,
    /// The load stayed above the limit, or the servo reported overload or heat.
    #[error("stopped at {position} counts: load {} %, errors: {}", f64::from(*load) / 10.0, error_words(*errors))]
    Overload {
        /// The position in counts.
        position: u16,
        /// The load in 0.1 % of the stall torque.
        load: i16,
        /// The error bits, as [`error_words`] names them.
        errors: u8,
    },
    /// The servo has come no nearer to the middle for [`CenterOptions::stall`].
    #[error("stopped at {position} counts: the servo makes no progress")]
    Stalled {
        /// The position in counts.
        position: u16,
    },
    /// The caller ended the move: `on_reading` returned `false`.
    #[error("interrupted")]
    Interrupted,
    /// An exchange with the servo failed.
    #[error(transparent)]
    Bus(#[from] ServoError),
    /// The torque could not be switched off. The servo may still be moving.
    #[error("the servo may still be moving: its torque could not be switched off ({0})")]
    TorqueStillOn(Box<CenterError>),
}

fn out_of_reach(limits: (u16, u16)) -> String {
    match limits {
        (0, 0) => "this servo has no range (both limits are 0): its motor would turn without end".to_owned(),
        (lowest, highest) => {
            format!("the servo's limits, {lowest} to {highest} counts, leave out its middle, {MIDDLE}")
        }
    }
}

/// Moves a servo to the middle and returns its position in counts. The servo holds there with torque on.
///
/// Calls `on_reading` with each reading; `false` ends the move.
///
/// # Errors
/// See [`CenterError`].
pub fn center(
    bus: &mut BusMaster,
    id: u8,
    options: &CenterOptions,
    mut on_reading: impl FnMut(&Reading) -> bool,
) -> Result<u16, CenterError> {
    let start = check(&ServoInfo::read(bus, id)?)?;
    let done = drive(bus, id, options, start, &mut on_reading);
    done.map_err(|cause| match bus.write(id, register::TORQUE_SWITCH, &TORQUE_OFF) {
        Ok(()) => cause,
        Err(_) => CenterError::TorqueStillOn(Box::new(cause)),
    })
}

/// The present position, if the servo can move to the middle.
fn check(facts: &ServoInfo) -> Result<u16, CenterError> {
    let (lowest, highest) = facts.position_limits;
    if facts.errors != 0 {
        return Err(CenterError::ReportsErrors { errors: facts.errors });
    }
    if facts.turns_endlessly() || !(lowest..=highest).contains(&MIDDLE) {
        return Err(CenterError::OutOfReach { limits: facts.position_limits });
    }
    facts.reading.map(|reading| reading.position_counts).ok_or(CenterError::Unmeasured)
}

fn drive(
    bus: &mut BusMaster,
    id: u8,
    options: &CenterOptions,
    start: u16,
    on_reading: &mut impl FnMut(&Reading) -> bool,
) -> Result<u16, CenterError> {
    bus.write(id, register::GOAL_POSITION, &goal(start, options.speed))?;
    bus.write(id, register::TORQUE_SWITCH, &TORQUE_ON)?;
    bus.write(id, register::GOAL_POSITION, &goal(MIDDLE, options.speed))?;
    let mut check = CenterCheck { closest: start.abs_diff(MIDDLE), since: bus.now(), overloaded: 0 };
    loop {
        bus.wait_for_silence(options.poll_period)?;
        let (reading, errors, is_moving) = measure(bus, id)?;
        if !on_reading(&reading) {
            return Err(CenterError::Interrupted);
        }
        check.update(&reading, errors, bus.now(), options)?;
        let is_close = reading.position_counts.abs_diff(MIDDLE) <= ARRIVED_COUNTS;
        // A servo that oscillates around its goal always reports that it moves.
        if is_close && (!is_moving || check.is_stalled(bus.now(), options)) {
            return Ok(reading.position_counts);
        }
    }
}

/// Position, time and speed as in registers 42 to 47.
fn goal(position: u16, speed: u16) -> [u8; 6] {
    let ([p1, p0], [s1, s0]) = (position.to_be_bytes(), speed.to_be_bytes());
    [p1, p0, 0, 0, s1, s0]
}

fn measure(bus: &mut BusMaster, id: u8) -> Result<(Reading, u8, bool), CenterError> {
    let answer = bus.read(id, register::PRESENT_POSITION, MEASURED)?;
    let reading = answer.values.get(..usize::from(Reading::REGISTERS)).and_then(Reading::parse);
    let is_moving = answer.values.last().is_some_and(|&moving| moving != 0);
    Ok((reading.ok_or(CenterError::Unmeasured)?, answer.errors, is_moving))
}

/// Progress and load of the move so far.
struct CenterCheck {
    /// The smallest distance to the middle, in counts.
    closest: u16,
    /// When the servo first came that close.
    since: Duration,
    /// Consecutive readings above the load limit.
    overloaded: u32,
}

impl CenterCheck {
    fn update(
        &mut self,
        reading: &Reading,
        errors: u8,
        now: Duration,
        options: &CenterOptions,
    ) -> Result<(), CenterError> {
        let &Reading { position_counts: position, load, .. } = reading;
        self.overloaded = if load.unsigned_abs() > options.load { self.overloaded + 1 } else { 0 };
        if self.overloaded >= OVERLOAD_READINGS || errors & (error::OVERLOAD | error::OVERHEAT) != 0 {
            return Err(CenterError::Overload { position, load, errors });
        }
        let distance = position.abs_diff(MIDDLE);
        if distance < self.closest {
            (self.closest, self.since) = (distance, now);
        }
        if distance > ARRIVED_COUNTS && self.is_stalled(now, options) {
            return Err(CenterError::Stalled { position });
        }
        Ok(())
    }

    fn is_stalled(&self, now: Duration, options: &CenterOptions) -> bool {
        now.saturating_sub(self.since) > options.stall
    }
}
