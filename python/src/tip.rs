//! `Tip`: where the arm's tip is.

use std::hash::{DefaultHasher, Hash, Hasher};

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sevenbot::cartesian::{DirectionText, PointText, TipPose, Vector};

use crate::arguments::PoseGoals;
use crate::numbers::PoseDegrees;

/// Where the arm is.
///
/// Positions are millimetres from the point where the axis of the base meets the top plate: x to the right, y forward,
/// z up. The tip is the middle of the disc that joint 6 turns. Tips of the same angles are equal.
#[pyclass(frozen, module = "sevenbot")]
pub(crate) struct Tip {
    angles: [f64; 7],
    pose: TipPose,
}

impl Tip {
    /// From the angles of all joints in degrees.
    pub(crate) fn at(angles: [f64; 7]) -> Self {
        let [t1, t2, t3, t4, t5, t6, _] = angles;
        Self { angles, pose: TipPose::at([t1, t2, t3, t4, t5, t6]) }
    }

    fn rows(&self) -> [(&'static str, String); 4] {
        let angles = self.angles.map(|angle| format!("{}", (angle * 100.0).round() / 100.0)).join(" ");
        [
            ("tip", format!("{} mm", PointText(self.pose.tip))),
            ("tool", DirectionText(self.pose.tool).to_string()),
            ("wrist", format!("{} mm", PointText(self.pose.wrist))),
            ("joints", format!("{angles} degrees")),
        ]
    }
}

#[pymethods]
impl Tip {
    /// Where an arm is whose seven angles are these, in degrees: forward kinematics, without an arm.
    #[staticmethod]
    #[pyo3(signature = (*angles))]
    fn of(py: Python<'_>, angles: &Bound<'_, PyTuple>) -> PyResult<Self> {
        Ok(Self::at(PoseGoals::of(angles)?.all(py)?))
    }

    /// The tip in millimetres: x, y, z.
    #[getter]
    fn tip(&self) -> (f64, f64, f64) {
        components(self.pose.tip)
    }

    /// The direction of the tool, of length 1: from the wrist to the tip.
    #[getter]
    fn tool(&self) -> (f64, f64, f64) {
        components(self.pose.tool)
    }

    /// The common point of the axes of joints 4, 5 and 6, in millimetres.
    #[getter]
    fn wrist(&self) -> (f64, f64, f64) {
        components(self.pose.wrist)
    }

    /// The angles of joints 1 to 7 in degrees.
    #[getter]
    fn angles(&self) -> PoseDegrees {
        self.angles.into()
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.angles == other.angles
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        // 0.0 and -0.0 are equal.
        self.angles.map(|angle| (angle + 0.0).to_bits()).hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PoseDegrees)> {
        Ok((py.get_type::<Self>().getattr("of")?, self.angles.into()))
    }

    fn __repr__(&self) -> String {
        format!("<Tip {}, tool {}>", PointText(self.pose.tip), DirectionText(self.pose.tool))
    }

    fn __str__(&self) -> String {
        self.rows().map(|(name, value)| format!("{name:<8}{value}")).join("\n")
    }

    fn _repr_html_(&self) -> String {
        html_table(&self.rows())
    }
}

/// A table of names and values.
pub(crate) fn html_table(rows: &[(&'static str, String)]) -> String {
    let rows = rows.iter().map(|(name, value)| format!("<tr><th>{name}</th><td>{value}</td></tr>"));
    format!("<table>{}</table>", rows.collect::<String>())
}

fn components(vector: Vector) -> (f64, f64, f64) {
    (vector.x, vector.y, vector.z)
}
