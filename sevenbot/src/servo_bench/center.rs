//! Brings a servo to the middle of its range, slowly, and stops when something is in the way.
//!
//! The servo first gets its present position as its goal and only then torque, so it starts without a jump.

use std::fmt;
use std::time::Duration;

use motion_core::servo_bus::Reading;
use motion_core::servo_bus::frame::{error, register};

use super::bus_master::BusMaster;
use super::error::ServoError;
use super::servo_info::{ServoInfo, error_words};

/// The middle of the range of 0 to 1023 counts.
pub const MIDDLE: u16 = 511;
/// A servo that is so close to its goal has arrived: its dead zone is 2 counts on either side.
const ARRIVED_COUNTS: u16 = 4;
/// The torque switch: on has this code in both of Feetech's tables.
const TORQUE_ON: [u8; 1] = [1];
/// Damping in the older table, free in the current one: no torque in either.
const TORQUE_OFF: [u8; 1] = [0];
/// Registers from the present position to the moving flag.
const MEASURED: u8 = register::MOVING - register::PRESENT_POSITION + 1;
/// A load over the limit in so many readings in a row ends the move. One reading may be a start from rest.
const OVERLOAD_READINGS: u32 = 5;

/// How a servo is moved.
#[derive(Clone, Copy, Debug)]
pub struct CenterOptions {
    /// In counts per second.
    pub speed: u16,
    /// The load that ends the move, in 0.1 % of the stall torque.
    pub load: u16,
    /// How often to look at the servo.
    pub poll_period: Duration,
    /// A servo that comes no closer for so long has met something.
    pub stall: Duration,
}

impl Default for CenterOptions {
    fn default() -> Self {
        Self { speed: 100, load: 600, poll_period: Duration::from_millis(20), stall: Duration::from_secs(3) }
    }
}

/// Why a servo is not in the middle. Whatever it was, its torque was switched off if that was possible.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CenterError {
    /// Its limits leave the middle out, or it has none. Nothing was written.
    OutOfReach {
        /// Lowest and highest position, in counts.
        limits: (u16, u16),
    },
    /// It reports errors before it moves. Nothing was written.
    ReportsErrors {
        /// The bits.
        errors: u8,
    },
    /// It gives no position that can be believed.
    Unmeasured,
    /// It pushed too hard, or reported an error.
    Overload {
        /// Where it was, in counts.
        position: u16,
        /// How hard it pushed, in 0.1 %.
        load: i16,
        /// Its error bits.
        errors: u8,
    },
    /// It does not come closer.
    Stalled {
        /// Where it is, in counts.
        position: u16,
    },
    /// The user wanted it to stop.
    Interrupted,
    /// The exchange failed.
    Bus(ServoError),
    /// The torque could not be switched off. The servo may still be moving.
    TorqueStillOn(Box<CenterError>),
}

impl From<ServoError> for CenterError {
    fn from(error: ServoError) -> Self {
        Self::Bus(error)
    }
}

impl fmt::Display for CenterError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfReach { limits: (0, 0) } => {
                out.write_str("this servo has no range (both limits are 0): its motor would turn on and on")
            }
            Self::OutOfReach { limits: (lowest, highest) } => {
                write!(
                    out,
                    "the servo's limits, {lowest} to {highest} counts, leave out its middle, {MIDDLE}"
                )
            }
            Self::ReportsErrors { errors } => write!(out, "the servo reports: {}", error_words(*errors)),
            Self::Unmeasured => out.write_str("the servo gives no position between 0 and 1023 counts"),
            Self::Overload { position, load, errors } => {
                let percent = f64::from(*load) / 10.0;
                write!(
                    out,
                    "stopped at {position} counts: load {percent} %, errors: {}",
                    error_words(*errors)
                )
            }
            Self::Stalled { position } => {
                write!(out, "stopped at {position} counts: the servo does not come closer")
            }
            Self::Interrupted => out.write_str("interrupted"),
            Self::Bus(error) => error.fmt(out),
            Self::TorqueStillOn(cause) => {
                write!(out, "the servo may still be moving, its torque could not be switched off: {cause}")
            }
        }
    }
}

impl std::error::Error for CenterError {}

/// Brings a servo to the middle, and gives where it stands then, in counts. It holds there, with torque.
///
/// `on_reading` is told of each reading. It answers whether to go on.
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

/// Where the servo stands, if it is fit to be moved to its middle.
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
    let mut check = MoveCheck { closest: start.abs_diff(MIDDLE), since: bus.now(), overloaded: 0 };
    loop {
        bus.wait_for_silence(options.poll_period)?;
        let (reading, errors, is_moving) = measure(bus, id)?;
        if !on_reading(&reading) {
            return Err(CenterError::Interrupted);
        }
        check.update(&reading, errors, bus.now(), options)?;
        let is_close = reading.position_counts.abs_diff(MIDDLE) <= ARRIVED_COUNTS;
        // A servo that hunts around its goal says for ever that it moves.
        if is_close && (!is_moving || check.is_stalled(bus.now(), options)) {
            return Ok(reading.position_counts);
        }
    }
}

/// Position, time and speed, as registers 42 to 47 hold them.
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

/// What was seen of the move so far.
struct MoveCheck {
    /// The smallest distance to the middle, in counts.
    closest: u16,
    /// When that was.
    since: Duration,
    /// Readings in a row with too much load.
    overloaded: u32,
}

impl MoveCheck {
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
