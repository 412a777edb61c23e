//! The arguments of methods, as the library takes them.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sevenbot::approach::ApproachRule;
use sevenbot::cartesian::Guard;
use sevenbot::fine::FineTargets;
use sevenbot::moves::Pace;
use sevenbot::{ArmOptions, FineAngle, Map, MoveTime, Speed};

use crate::simulation::duration;

/// Angles of a pose: a number for each joint, or `None` for a joint that stays.
#[derive(FromPyObject)]
pub(crate) struct Goals([Option<f64>; 7]);

impl Goals {
    /// Seven angles, or one list of seven.
    pub(crate) fn of(angles: &Bound<'_, PyTuple>) -> PyResult<Self> {
        match angles.len() {
            1 => angles.get_item(0)?.extract(),
            7 => Ok(Self(angles.extract()?)),
            other => Err(PyTypeError::new_err(format!("{other} angles: use seven, or a list of seven"))),
        }
    }

    /// As the library takes them.
    pub(crate) fn targets(&self) -> PyResult<FineTargets> {
        let mut targets = [None; 7];
        for ((target, goal), number) in targets.iter_mut().zip(self.0).zip(1..) {
            let Some(degrees) = goal else { continue };
            let angle = FineAngle::from_degrees(degrees);
            *target = Some(angle.ok_or_else(|| {
                PyValueError::new_err(format!(
                    "joint {number}: {degrees} is out of range: use 0 to 180 degrees"
                ))
            })?);
        }
        Ok(targets)
    }
}

/// A pace: speed in degrees/s, in steps of 1.9; duration in seconds, in steps of 0.1.
pub(crate) fn pace(speed: Option<f64>, duration: Option<f64>) -> PyResult<Pace> {
    if speed.is_some() && duration.is_some() {
        return Err(PyTypeError::new_err("give a speed or a duration, not both"));
    }
    let wrong = |text: &str| PyValueError::new_err(text.to_owned());
    let speed = speed.map(|speed| {
        let found =
            (1..=100).filter_map(Speed::from_steps).rfind(|step| step.degrees_per_second() <= speed + 0.05);
        found.filter(|_| speed <= 190.05).ok_or_else(|| wrong("use a speed of 1.9 to 190 degrees per second"))
    });
    let time = duration.map(|duration| {
        let found = (1..=100)
            .filter_map(MoveTime::from_steps)
            .find(|step| step.duration().as_secs_f64() >= duration - 0.001);
        found.filter(|_| duration > 0.0).ok_or_else(|| wrong("use a duration of 0.1 to 10 seconds"))
    });
    Ok(Pace { speed: speed.transpose()?, time: time.transpose()? })
}

/// The guard of the workspace: `table` is the height of the table in mm; with `guard=False` there is none.
pub(crate) fn guard(table: Option<f64>, guard: bool) -> PyResult<Option<Guard>> {
    match table {
        Some(_) if !guard => Err(PyTypeError::new_err("give a table or guard=False, not both")),
        Some(table) if !table.is_finite() => Err(PyValueError::new_err("use a finite height of the table")),
        table => Ok(guard.then(|| table.map_or_else(Guard::default, Guard::above))),
    }
}

/// The rule for the way to a first point: `approach` is its time in seconds.
pub(crate) fn approach(seconds: Option<f64>) -> PyResult<ApproachRule> {
    match seconds {
        None => Ok(ApproachRule::Near),
        Some(seconds) if (0.1..=60.0).contains(&seconds) => Ok(ApproachRule::Within(duration(seconds)?)),
        Some(_) => Err(PyValueError::new_err("use an approach of 0.1 to 60 seconds")),
    }
}

/// How a port is opened. The timeout is in seconds.
pub(crate) fn options(baud: u32, timeout: f64, attempts: u32, map: Option<&str>) -> PyResult<ArmOptions> {
    let wanted = |version: &str| {
        let found = Map::ALL.into_iter().find(|map| map.version() == version);
        found.ok_or_else(|| PyValueError::new_err(format!("map {version}: use \"2.1\" or \"2.2\"")))
    };
    Ok(ArmOptions { baud, reply_timeout: duration(timeout)?, attempts, map: map.map(wanted).transpose()? })
}
