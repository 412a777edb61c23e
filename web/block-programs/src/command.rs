//! The commands and sensors of a program, and the ranges of their numbers.

use std::ops::RangeInclusive;
use std::time::Duration;

use sevenbot::cartesian::Vector;
use sevenbot::fine::FineTargets;
use sevenbot::moves::Pace;
use sevenbot::{FineAngle, Joint, MoveTime, Speed};

use crate::fault::{ProgramFault, Quantity};

/// Speeds of the tip on a straight line, in mm/s. The Python package has the same range.
pub const LINE_SPEEDS: RangeInclusive<f64> = 1.0..=500.0;
/// The longest wait, in seconds: a day. The Python package has the same limit.
const LONGEST_WAIT: f64 = 86_400.0;
/// The angles of joint 7 at which the claw is open and closed, in degrees.
pub(crate) const CLAW: [f64; 2] = [84.0, 0.0];

/// A command for the arm. The program goes on when the arm has carried it out.
#[derive(Clone, Debug, PartialEq)]
pub enum ProgramCommand {
    /// Joints go to targets.
    Joints {
        /// One target for each joint; `None` for a joint that does not move.
        targets: FineTargets,
        /// The speed, or the duration.
        pace: Pace,
    },
    /// The tip goes to a point. The joints move independently of each other, so the path of the tip is not straight.
    Tip {
        /// The point, in millimetres.
        tip: Vector,
        /// The direction of the tool, of length 1.
        tool: Vector,
        /// The speed of the joints.
        pace: Pace,
    },
    /// The tip goes to a point on a straight line.
    Line {
        /// The point, in millimetres.
        tip: Vector,
        /// The direction of the tool, of length 1.
        tool: Vector,
        /// The speed of the tip, in millimetres per second.
        speed: f64,
    },
    /// The gripper opens or closes. It may stop at an object before it reaches its target.
    Grip {
        /// The target of joint 7.
        claw: FineAngle,
    },
    /// Switches the vacuum pump: true is on.
    Vacuum(bool),
    /// The program waits for this time.
    Wait(Duration),
}

/// A value that a program reads from the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// The measured angle of a joint, in degrees.
    Angle(Joint),
    /// The position of the tip along an axis, in millimetres.
    Tip(Axis),
    /// The load of a joint, in percent of the stall torque.
    Load(Joint),
    /// Does an obstacle keep a joint from its target? Register 195 (D27).
    Blocked(Joint),
    /// Does the gripper hold something?
    Gripping,
}

/// An axis of positions: x to the right, y forward, z up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// To the right.
    X,
    /// Forward.
    Y,
    /// Up.
    Z,
}

/// The direction in which the tool points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NamedDirection {
    Down,
    Forward,
    Left,
    Right,
    Up,
}

impl NamedDirection {
    /// The direction as a unit vector: x, y, z.
    pub(crate) const fn direction(self) -> [i8; 3] {
        match self {
            Self::Down => [0, 0, -1],
            Self::Forward => [0, 1, 0],
            Self::Left => [-1, 0, 0],
            Self::Right => [1, 0, 0],
            Self::Up => [0, 0, 1],
        }
    }

    pub(crate) fn vector(self) -> Vector {
        let [x, y, z] = self.direction().map(f64::from);
        Vector::new(x, y, z)
    }
}

const fn out_of_range(quantity: Quantity, value: f64, lowest: f64, highest: f64) -> ProgramFault {
    ProgramFault::OutOfRange { quantity, value, lowest, highest }
}

/// The target of a joint, in degrees. Fails outside 0 to 180.
pub(crate) fn angle(degrees: f64) -> Result<FineAngle, ProgramFault> {
    FineAngle::from_degrees(degrees).ok_or(out_of_range(Quantity::Angle, degrees, 0.0, 180.0))
}

/// The pace of joints at this speed, in degrees per second.
pub(crate) fn joint_pace(speed: f64) -> Result<Pace, ProgramFault> {
    let steps = Speed::at_most(speed).ok_or(out_of_range(Quantity::JointSpeed, speed, 1.9, 190.0))?;
    Ok(Pace { speed: Some(steps), time: None })
}

/// The pace of joints that move for this time, in seconds.
pub(crate) fn timed_pace(seconds: f64) -> Result<Pace, ProgramFault> {
    let time = MoveTime::at_least(seconds).ok_or(out_of_range(Quantity::Time, seconds, 0.1, 10.0))?;
    Ok(Pace { speed: None, time: Some(time) })
}

/// Checks a speed of the tip, in millimetres per second, against [`LINE_SPEEDS`].
pub(crate) fn line_speed(speed: f64) -> Result<f64, ProgramFault> {
    let (lowest, highest) = (*LINE_SPEEDS.start(), *LINE_SPEEDS.end());
    let is_allowed = LINE_SPEEDS.contains(&speed);
    is_allowed.then_some(speed).ok_or(out_of_range(Quantity::TipSpeed, speed, lowest, highest))
}

/// A time to wait, in seconds. Fails if it is negative or longer than [`LONGEST_WAIT`].
pub(crate) fn wait(seconds: f64) -> Result<Duration, ProgramFault> {
    let time = Duration::try_from_secs_f64(seconds).ok().filter(|_| seconds <= LONGEST_WAIT);
    time.ok_or(out_of_range(Quantity::Time, seconds, 0.0, LONGEST_WAIT))
}
