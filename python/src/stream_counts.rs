//! `StreamCounts`: how the actions of a program became points of a stream.

use pyo3::prelude::*;
use sevenbot::stream::LatestCounts;

/// How the actions of `Stream.latest` became points so far.
#[pyclass(frozen, get_all, eq, hash, module = "sevenbot")]
#[derive(PartialEq, Eq, Hash)]
pub(crate) struct StreamCounts {
    /// Points that were sent, repeated ones included.
    sent: u32,
    /// Actions that a newer one replaced before a point was due.
    skipped: u32,
    /// Points without a new action: the last one again.
    repeated: u32,
    /// Points that were due and not sent, because the sender was late.
    missed: u32,
    /// How often the program was silent until the watchdog of the arm acted.
    watchdog: u32,
}

impl From<LatestCounts> for StreamCounts {
    fn from(counts: LatestCounts) -> Self {
        let LatestCounts { sent, skipped, repeated, missed, watchdog } = counts;
        Self { sent, skipped, repeated, missed, watchdog }
    }
}

/// The arguments of [`StreamCounts::_of`].
type PickledCounts = (u32, u32, u32, u32, u32);

#[pymethods]
impl StreamCounts {
    /// From its numbers: what `pickle` calls.
    #[staticmethod]
    const fn _of(sent: u32, skipped: u32, repeated: u32, missed: u32, watchdog: u32) -> Self {
        Self { sent, skipped, repeated, missed, watchdog }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledCounts)> {
        let arguments = (self.sent, self.skipped, self.repeated, self.missed, self.watchdog);
        Ok((py.get_type::<Self>().getattr("_of")?, arguments))
    }

    fn __repr__(&self) -> String {
        let Self { sent, skipped, repeated, missed, watchdog } = self;
        format!(
            "<StreamCounts: {sent} sent, {skipped} skipped, {repeated} repeated, {missed} missed, watchdog acted {watchdog} times>"
        )
    }
}
