//! `Recording`: a movement as a text file, and as arrays.

use std::fs;
use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyType;
use sevenbot::recording::{FileVersion, Moment, Recording as Moments, head};

use crate::bulk;
use crate::errors::raised;

/// A movement: times in seconds, angles of joints 1 to 7 in degrees, and the vacuum pump.
///
/// The file is that of `sevenbot record`: text, one line for each moment.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Recording(Moments);

impl Recording {
    pub(crate) fn parse(py: Python<'_>, text: &str) -> PyResult<Self> {
        raised(py, Moments::parse(text)).map(Self)
    }

    pub(crate) const fn moments(&self) -> &Moments {
        &self.0
    }

    fn text(&self) -> String {
        let lines = self.0.moments().map(|moment| moment.line(FileVersion::Hundredths) + "\n");
        head(FileVersion::Hundredths) + &lines.collect::<String>()
    }
}

#[pymethods]
impl Recording {
    /// Reads a file.
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Self::parse(py, &fs::read_to_string(path)?)
    }

    /// From times in seconds, in ascending order, and as many rows of seven angles, 0 to 180 degrees.
    #[classmethod]
    #[pyo3(signature = (times, angles, vacuum = None))]
    fn from_points(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        times: Vec<f64>,
        angles: Vec<[f64; 7]>,
        vacuum: Option<Vec<bool>>,
    ) -> PyResult<Self> {
        let vacuum = vacuum.unwrap_or_else(|| vec![false; times.len()]);
        if times.len() != angles.len() || times.len() != vacuum.len() {
            return Err(PyValueError::new_err("times, angles and vacuum have different lengths"));
        }
        let lines = times.iter().zip(&angles).zip(&vacuum).map(|((time, angles), vacuum)| {
            let angles = angles.map(|angle| format!(" {angle:.2}")).concat();
            format!("{time:.3}{angles} {}\n", u8::from(*vacuum))
        });
        Self::parse(py, &(head(FileVersion::Hundredths) + &lines.collect::<String>()))
    }

    /// Writes a file, which `sevenbot play` takes, too.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        Ok(fs::write(path, self.text())?)
    }

    /// The times of the moments in seconds: a numpy array, or a tuple without numpy.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let times: Vec<f64> = self.0.moments().map(|moment| moment.time.as_secs_f64()).collect();
        bulk::numbers(py, &times)
    }

    /// The angles in degrees, one row of seven for each moment: a numpy array, or a tuple of lists without numpy.
    #[getter]
    fn angles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let degrees = |moment: Moment| moment.pose.map(sevenbot::FineAngle::degrees);
        bulk::angles(py, &self.0.moments().map(degrees).collect::<Vec<_>>())
    }

    /// Does the vacuum pump suck? One for each moment.
    #[getter]
    fn vacuum(&self) -> Vec<bool> {
        self.0.moments().map(|moment| moment.vacuum).collect()
    }

    /// The time from the first moment to the last, in seconds.
    #[getter]
    fn duration(&self) -> f64 {
        self.0.duration().as_secs_f64()
    }

    /// Checks that every joint can follow at `speed` times the recorded speed. Raises `BadRecording`.
    #[pyo3(signature = (speed = 1.0))]
    fn check(&self, py: Python<'_>, speed: f64) -> PyResult<()> {
        raised(py, self.0.check_speeds(speed))
    }

    fn __len__(&self) -> usize {
        self.0.moments().count()
    }

    fn __repr__(&self) -> String {
        format!("<Recording: {} moments in {:.1} s>", self.__len__(), self.duration())
    }
}
