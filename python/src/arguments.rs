//! The arguments of methods, as the library takes them.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sevenbot::approach::ApproachRule;
use sevenbot::cartesian::{DOWN, Guard, Vector};
use sevenbot::fine::FineTargets;
use sevenbot::moves::Pace;
use sevenbot::stream::{StreamOptions, WatchdogAction};
use sevenbot::{ArmOptions, FineAngle, Map, MoveTime, Speed};

use crate::errors::{InvalidType, InvalidValue};
use crate::numbers::{duration, elements, real};

const WHAT_ANGLES: &str =
    "angles are seven numbers, or one list or array of seven, with None for a joint that stays";

/// Angles of a pose: a number for each joint, or `None` for a joint that stays.
pub(crate) struct PoseGoals([Option<f64>; 7]);

impl<'py> FromPyObject<'_, 'py> for PoseGoals {
    type Error = PyErr;

    fn extract(angles: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let py = angles.py();
        let elements = elements(&angles, 7)?.ok_or_else(|| InvalidType::raise(py, WHAT_ANGLES))?;
        if elements.len() != 7 {
            return Err(InvalidType::raise(py, &format!("{WHAT_ANGLES}: here are {}", elements.len())));
        }
        let mut goals = [None; 7];
        for (goal, angle) in goals.iter_mut().zip(&elements) {
            let number = || real(angle).ok_or_else(|| InvalidType::raise(py, WHAT_ANGLES));
            *goal = if angle.is_none() { None } else { Some(number()?) };
        }
        Ok(Self(goals))
    }
}

impl PoseGoals {
    /// Seven angles, or one list of seven.
    pub(crate) fn of(angles: &Bound<'_, PyTuple>) -> PyResult<Self> {
        match angles.len() {
            1 => angles.get_item(0)?.extract(),
            _ => angles.extract(),
        }
    }

    /// The targets in the types of the library. Fails if an angle is not within 0 to 180 degrees.
    pub(crate) fn targets(&self, py: Python<'_>) -> PyResult<FineTargets> {
        let mut targets = [None; 7];
        for ((target, goal), number) in targets.iter_mut().zip(self.0).zip(1..) {
            let Some(degrees) = goal else { continue };
            *target = Some(angle(py, &format!("joint {number}: "), degrees)?);
        }
        Ok(targets)
    }

    /// All seven angles in degrees, each 0 to 180.
    pub(crate) fn all(&self, py: Python<'_>) -> PyResult<[f64; 7]> {
        let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g)] = self.targets(py)? else {
            return Err(InvalidType::raise(py, "None is not allowed here: give all seven angles"));
        };
        Ok([a, b, c, d, e, f, g].map(FineAngle::degrees))
    }
}

/// An angle of 0 to 180 degrees.
pub(crate) fn angle(py: Python<'_>, of: &str, degrees: f64) -> PyResult<FineAngle> {
    let angle = FineAngle::from_degrees(degrees);
    angle.ok_or_else(|| {
        InvalidValue::raise(py, &format!("{of}{degrees} is out of range: use 0 to 180 degrees"))
    })
}

/// The direction of a tool.
pub(crate) struct ToolDirection(Vector);

impl ToolDirection {
    /// Straight down if none is given.
    pub(crate) fn or_down(direction: Option<Self>) -> Vector {
        direction.map_or(DOWN, |Self(direction)| direction)
    }
}

impl<'py> FromPyObject<'_, 'py> for ToolDirection {
    type Error = PyErr;

    fn extract(direction: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let numbers: Option<Vec<f64>> =
            elements(&direction, 3)?.and_then(|elements| elements.iter().map(real).collect());
        match numbers.as_deref() {
            Some([x, y, z]) => Ok(Self(Vector::new(*x, *y, *z))),
            _ => Err(InvalidType::raise(direction.py(), "tool is a direction of three numbers: x, y and z")),
        }
    }
}

/// The name of a port: a text, or a path.
pub(crate) struct PortName(pub(crate) String);

impl<'py> FromPyObject<'_, 'py> for PortName {
    type Error = PyErr;

    fn extract(port: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let path = port.call_method0("__fspath__").and_then(|path| path.extract());
        let name = port.extract().or(path);
        name.map(Self)
            .map_err(|_| InvalidType::raise(port.py(), "port is a name, as \"/dev/ttyUSB0\", or a path"))
    }
}

fn refuse_both(py: Python<'_>, speed: Option<f64>, duration: Option<f64>) -> PyResult<()> {
    match (speed, duration) {
        (Some(_), Some(_)) => Err(InvalidType::raise(py, "give a speed or a duration, not both")),
        _ => Ok(()),
    }
}

/// A pace: speed in degrees/s, in steps of 1.9; duration in seconds, in steps of 0.1.
pub(crate) fn pace(py: Python<'_>, speed: Option<f64>, duration: Option<f64>) -> PyResult<Pace> {
    refuse_both(py, speed, duration)?;
    let wrong = |text: &str| InvalidValue::raise(py, text);
    let speed = speed.map(|speed| {
        Speed::at_most(speed).ok_or_else(|| wrong("use a speed of 1.9 to 190 degrees per second"))
    });
    let time = duration.map(|seconds| {
        MoveTime::at_least(seconds).ok_or_else(|| wrong("use a duration of 0.1 to 10 seconds"))
    });
    Ok(Pace { speed: speed.transpose()?, time: time.transpose()? })
}

/// The pace of the tip on a straight line.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LinePace {
    /// In millimetres per second.
    Speed(f64),
    /// The time for the whole line, in seconds.
    Within(f64),
}

/// The allowed speeds of the tip on a straight line, in mm/s.
pub(crate) const LINE_SPEEDS: std::ops::RangeInclusive<f64> = 1.0..=500.0;
/// Speed of the tip if none is given, in mm/s.
const DEFAULT_LINE_SPEED: f64 = 50.0;

/// A pace of the tip: speed in mm/s, or duration in seconds.
pub(crate) fn line_pace(py: Python<'_>, speed: Option<f64>, duration: Option<f64>) -> PyResult<LinePace> {
    refuse_both(py, speed, duration)?;
    match (speed, duration) {
        (Some(speed), _) if !LINE_SPEEDS.contains(&speed) => {
            Err(InvalidValue::raise(py, "use a speed of the tip of 1 to 500 millimetres per second"))
        }
        (_, Some(seconds)) if !(0.1..=600.0).contains(&seconds) => {
            Err(InvalidValue::raise(py, "use a duration of a straight line of 0.1 to 600 seconds"))
        }
        (_, Some(seconds)) => Ok(LinePace::Within(seconds)),
        (speed, None) => Ok(LinePace::Speed(speed.unwrap_or(DEFAULT_LINE_SPEED))),
    }
}

/// The guard of the workspace: `table` is the height of the table in mm; with `guard=False` there is none.
pub(crate) fn guard(py: Python<'_>, table: Option<f64>, guard: bool) -> PyResult<Option<Guard>> {
    match table {
        Some(_) if !guard => Err(InvalidType::raise(py, "give a table or guard=False, not both")),
        Some(table) if !table.is_finite() => Err(InvalidValue::raise(py, "use a finite height of the table")),
        table => Ok(guard.then(|| table.map_or_else(Guard::default, Guard::above))),
    }
}

/// The rule for the way to a first point: it takes `seconds`, or longer if a joint would be too fast. With `None` the first point
/// has to be near.
pub(crate) fn approach(py: Python<'_>, seconds: Option<f64>) -> PyResult<ApproachRule> {
    match seconds {
        None => Ok(ApproachRule::Near),
        Some(seconds) if (0.1..=60.0).contains(&seconds) => Ok(ApproachRule::Within(duration(py, seconds)?)),
        Some(_) => Err(InvalidValue::raise(py, "use an approach of 0.1 to 60 seconds")),
    }
}

/// The options of a stream. `period` and `watchdog` are seconds; with `damping` the watchdog lets the arm sink.
pub(crate) fn stream(py: Python<'_>, period: f64, watchdog: f64, damping: bool) -> PyResult<StreamOptions> {
    let milliseconds = Some(period).filter(|period| (0.005..=1.0).contains(period));
    let options = milliseconds.map(|period| steps(period * 1_000.0)).and_then(StreamOptions::new);
    let options = options
        .ok_or_else(|| InvalidValue::raise(py, &format!("a period of {period} s: use 0.005 to 1 s")))?;
    let hundredths = Some(watchdog).filter(|&time| time == 0.0 || (0.01..=2.55).contains(&time));
    let hundredths = hundredths.and_then(|watchdog| u8::try_from(steps(watchdog * 100.0)).ok());
    let hundredths = hundredths.ok_or_else(|| {
        InvalidValue::raise(py, &format!("a watchdog of {watchdog} s: use 0.01 to 2.55 s, or 0 for none"))
    })?;
    let action = if damping { WatchdogAction::Damping } else { WatchdogAction::Hold };
    Ok(options.with_watchdog(hundredths, action))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked: 0 to 1000")]
fn steps(number: f64) -> u16 {
    number.round() as u16
}

/// The arguments that say how a port is opened.
#[derive(Clone, Copy)]
pub(crate) struct OpenArguments<'a> {
    pub(crate) baud: i64,
    /// In seconds.
    pub(crate) timeout: f64,
    pub(crate) attempts: i64,
    pub(crate) map: Option<&'a str>,
}

impl OpenArguments<'_> {
    pub(crate) fn options(self, py: Python<'_>) -> PyResult<ArmOptions> {
        let wanted = |version: &str| {
            let found = Map::ALL.into_iter().find(|map| map.version() == version);
            found.ok_or_else(|| InvalidValue::raise(py, &format!("map {version}: use \"2.1\" or \"2.2\"")))
        };
        Ok(ArmOptions {
            baud: baud_rate(py, self.baud)?,
            reply_timeout: duration(py, self.timeout)?,
            attempts: whole(py, "attempts", self.attempts, 1, 1_000)?,
            map: self.map.map(wanted).transpose()?,
        })
    }
}

/// The baud rate of a port. The slowest rate of the arm is 9,600; below 1,200 a long answer takes seconds.
pub(crate) fn baud_rate(py: Python<'_>, baud: i64) -> PyResult<u32> {
    whole(py, "baud", baud, 1_200, 4_000_000)
}

/// A whole number within a range.
pub(crate) fn whole<T: TryFrom<i64>>(
    py: Python<'_>,
    name: &str,
    number: i64,
    low: i64,
    high: i64,
) -> PyResult<T> {
    let found =
        Some(number).filter(|number| (low..=high).contains(number)).and_then(|number| number.try_into().ok());
    found.ok_or_else(|| {
        InvalidValue::raise(py, &format!("{name}: {number} is out of range: use {low} to {high}"))
    })
}
