//! `Recording`: a movement as a text file, and as arrays.

use std::fs::File;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;

use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PySlice, PyType};
use recording_formats::{Format, ReadError};
use sevenbot::recording::{FileVersion, Moment, Recording as Moments, head};
use sevenbot::whole_file;

use crate::bulk;
use crate::errors::{InvalidType, InvalidValue, file_error, raised};
use crate::numbers::{Numbers, PoseDegrees, Rows, elements};

/// A movement: times in seconds, angles of joints 1 to 7 in degrees, and the vacuum pump.
///
/// The file is that of `sevenbot record`: text, one line for each moment. `recording[0]` is the first moment: its time, its
/// angles, and whether the pump sucks. `recording[10:20]` is a part, and `len(recording)` the number of moments. Recordings
/// with the same moments are equal.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Recording {
    moments: Moments,
    arrivals: Option<Vec<f64>>,
}

impl Recording {
    /// From the text of a file, without times of arrival.
    pub(crate) fn of_text(py: Python<'_>, text: &str) -> PyResult<Self> {
        raised(py, Moments::parse(text)).map(|moments| Self { moments, arrivals: None })
    }

    pub(crate) fn with_arrivals(self, arrivals: Vec<f64>) -> Self {
        Self { arrivals: Some(arrivals), ..self }
    }

    pub(crate) const fn moments(&self) -> &Moments {
        &self.moments
    }

    fn text_of(moments: impl Iterator<Item = Moment>) -> String {
        let lines = moments.map(|moment| moment.line(FileVersion::Hundredths) + "\n");
        head(FileVersion::Hundredths) + &lines.collect::<String>()
    }
}

/// The arguments of [`Recording::parse`].
type PickledRecording = (String, Option<Vec<f64>>);

/// A moment in Python: time, angles, pump.
fn told(moment: Moment) -> (f64, PoseDegrees, bool) {
    (moment.time.as_secs_f64(), moment.pose.map(sevenbot::FineAngle::degrees).into(), moment.vacuum)
}

#[pymethods]
impl Recording {
    /// Reads a file: text, CSV or MCAP, which its first bytes tell.
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let file = File::open(&path).map_err(|why| file_error(py, &path, &why))?;
        match recording_formats::read(file) {
            Err(ReadError::Io(why)) => Err(file_error(py, &path, &why)),
            read => raised(py, read).map(|moments| Self { moments, arrivals: None }),
        }
    }

    /// From the text of a file, as `str(recording)` gives it, and the times of arrival.
    #[classmethod]
    #[pyo3(signature = (text, arrivals = None))]
    fn parse(_: &Bound<'_, PyType>, py: Python<'_>, text: &str, arrivals: Option<Numbers>) -> PyResult<Self> {
        let recording = Self::of_text(py, text)?;
        let Some(Numbers(arrivals)) = arrivals else { return Ok(recording) };
        if arrivals.len() != recording.__len__() {
            let (moments, arrivals) = (recording.__len__(), arrivals.len());
            let text =
                format!("{arrivals} times of arrival for {moments} moments: they need the same number");
            return Err(InvalidValue::raise(py, &text));
        }
        Ok(recording.with_arrivals(arrivals))
    }

    /// From times in seconds, in ascending order, and as many rows of seven angles, 0 to 180 degrees.
    #[classmethod]
    #[pyo3(signature = (times, angles, vacuum = None))]
    fn from_points(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        times: Numbers,
        angles: Rows,
        vacuum: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (Numbers(times), Rows(angles)) = (times, angles);
        let vacuum = vacuum.map_or_else(|| Ok(vec![false; times.len()]), |vacuum| switches(py, vacuum))?;
        if times.len() != angles.len() || times.len() != vacuum.len() {
            let (times, angles, vacuum) = (times.len(), angles.len(), vacuum.len());
            let text = format!(
                "times, angles and vacuum have the lengths {times}, {angles} and {vacuum}: use the same length"
            );
            return Err(InvalidValue::raise(py, &text));
        }
        let lines = times.iter().zip(&angles).zip(&vacuum).map(|((time, angles), vacuum)| {
            let angles = angles.map(|angle| format!(" {angle:.2}")).concat();
            format!("{time:.3}{angles} {}\n", u8::from(*vacuum))
        });
        Self::of_text(py, &(head(FileVersion::Hundredths) + &lines.collect::<String>()))
    }

    /// Writes a file, which `sevenbot play` takes, too: CSV for a name with `.csv` at its end, MCAP with messages of ROS 2 for
    /// `.mcap`, else text.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let format = Format::of_name(&path).unwrap_or(Format::Text);
        let mut bytes = Vec::new();
        let written = recording_formats::write(&self.moments, format, &mut bytes);
        written.and_then(|()| whole_file::write(&path, &bytes)).map_err(|why| file_error(py, &path, &why))
    }

    /// The times of the moments in seconds: a numpy array, or a tuple without numpy.
    ///
    /// `Arm.record` has the times of measurement: the arm measures at even times, and a moment that arrives late still has the
    /// time at which it was measured.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let times: Vec<f64> = self.moments.moments().map(|moment| moment.time.as_secs_f64()).collect();
        bulk::numbers(py, &times)
    }

    /// When each moment of `Arm.record` arrived here, in seconds since the first: as `times`. `None` for another recording.
    #[getter]
    fn arrivals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.arrivals.as_ref().map(|arrivals| bulk::numbers(py, arrivals)).transpose()
    }

    /// The angles in degrees, one row of seven for each moment: a numpy array, or a tuple of lists without numpy.
    #[getter]
    fn angles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let degrees = |moment: Moment| moment.pose.map(sevenbot::FineAngle::degrees);
        bulk::angles(py, &self.moments.moments().map(degrees).collect::<Vec<_>>())
    }

    /// Does the vacuum pump suck? One for each moment.
    #[getter]
    fn vacuum(&self) -> Vec<bool> {
        self.moments.moments().map(|moment| moment.vacuum).collect()
    }

    /// The time from the first moment to the last, in seconds.
    #[getter]
    fn duration(&self) -> f64 {
        self.moments.duration().as_secs_f64()
    }

    /// Checks that every joint can follow at `speed` times the recorded speed. Raises `BadRecording`.
    #[pyo3(signature = (speed = 1.0))]
    fn check(&self, py: Python<'_>, speed: f64) -> PyResult<()> {
        if !(speed.is_finite() && speed > 0.0) {
            return Err(InvalidValue::raise(py, "use a positive speed: 2 is twice that of the recording"));
        }
        raised(py, self.moments.check_speeds(speed))
    }

    fn __len__(&self) -> usize {
        self.moments.moments().count()
    }

    fn __getitem__(&self, py: Python<'_>, index: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        let length = isize::try_from(self.__len__()).unwrap_or(isize::MAX);
        if let Ok(slice) = index.cast::<PySlice>() {
            let at = slice.indices(length)?;
            return Ok(self
                .part(py, (at.start, at.step), at.slicelength)?
                .into_pyobject(py)?
                .into_any()
                .unbind());
        }
        let index: isize =
            index.call_method0("__index__").and_then(|index| index.extract()).map_err(|_| {
                InvalidType::raise(py, "a recording has the numbers of its moments, and slices, as indices")
            })?;
        let index = if index < 0 { index.saturating_add(length) } else { index };
        let moment = usize::try_from(index).ok().and_then(|index| self.moments.moments().nth(index));
        let moment =
            moment.ok_or_else(|| PyIndexError::new_err("the recording has no moment of this number"))?;
        Ok(told(moment).into_pyobject(py)?.into_any().unbind())
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let moments: Vec<_> = self.moments.moments().map(told).collect();
        Ok(moments.into_pyobject(py)?.call_method0("__iter__")?.unbind())
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.moments.moments().eq(other.moments.moments())
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.__str__().hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledRecording)> {
        Ok((py.get_type::<Self>().getattr("parse")?, (self.__str__(), self.arrivals.clone())))
    }

    fn __str__(&self) -> String {
        Self::text_of(self.moments.moments())
    }

    fn __repr__(&self) -> String {
        format!("<Recording: {} moments in {:.1} s>", self.__len__(), self.duration())
    }
}

impl Recording {
    /// Each `step`-th moment from `start` on, `length` moments at most. Fails for a negative step, because time goes forward,
    /// and if no moment is left.
    fn part(&self, py: Python<'_>, (start, step): (isize, isize), length: usize) -> PyResult<Self> {
        let (Ok(start), Ok(step @ 1..)) = (usize::try_from(start), usize::try_from(step)) else {
            return Err(InvalidValue::raise(py, "a part of a recording goes forward: use a positive step"));
        };
        let moments = self.moments.moments().skip(start).step_by(step).take(length);
        let part = Self::of_text(py, &Self::text_of(moments))?;
        let arrivals = self.arrivals.as_ref().map(|arrivals| {
            arrivals.iter().copied().skip(start).step_by(step).take(length).collect::<Vec<_>>()
        });
        Ok(Self { arrivals, ..part })
    }
}

/// Converts numbers or truth values to on or off.
fn switches(py: Python<'_>, vacuum: &Bound<'_, PyAny>) -> PyResult<Vec<bool>> {
    let wrong = || InvalidType::raise(py, "vacuum is a list or an array of truths");
    let each = elements(vacuum, usize::MAX)?.ok_or_else(wrong)?;
    each.iter().map(|one| one.is_truthy().map_err(|_| wrong())).collect()
}
