//! Kinematics, limits and models, without an arm.

use kinematics::geometry::{CLAW_MAX, JOINT_MAX};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sevenbot::Joint;
use sevenbot::cartesian::{TipTarget, Vector};

use crate::arguments::{PoseGoals, ToolDirection};
use crate::bulk;
use crate::errors::{InvalidValue, raised};
use crate::tip::Tip;

/// Where an arm is whose seven angles are these, in degrees: forward kinematics. The same as `Tip.of`.
#[pyfunction]
#[pyo3(signature = (*angles))]
pub(crate) fn forward(py: Python<'_>, angles: &Bound<'_, PyTuple>) -> PyResult<Tip> {
    Ok(Tip::at(PoseGoals::of(angles)?.all(py)?))
}

/// The angles of joints 1 to 5 in degrees that bring the tip to x, y, z in millimetres, with the tool in this direction, by
/// default straight down: inverse kinematics. With numpy an array.
///
/// Raises `OutOfReach` with the nearest point within reach. It ignores the table and the base, which `Arm.move_to` avoids.
#[pyfunction]
#[pyo3(signature = (x, y, z, *, tool = None))]
pub(crate) fn inverse(
    py: Python<'_>,
    x: f64,
    y: f64,
    z: f64,
    tool: Option<ToolDirection>,
) -> PyResult<Bound<'_, PyAny>> {
    let target = TipTarget::guarded(Vector::new(x, y, z), ToolDirection::or_down(tool), None);
    bulk::numbers(py, &raised(py, target)?.angles)
}

/// The smallest and the largest angles of joints 1 to 7 in degrees: two arrays with numpy, or tuples.
///
/// The linkage keeps joints 2 and 3 together: joint 2 + joint 3 - 65 is 19 to 161.
#[pyfunction]
pub(crate) fn limits(py: Python<'_>) -> PyResult<(Bound<'_, PyAny>, Bound<'_, PyAny>)> {
    let high = Joint::ALL.map(|joint| if joint.number() == 7 { CLAW_MAX } else { JOINT_MAX });
    Ok((bulk::numbers(py, &[0.0; 7])?, bulk::numbers(py, &high)?))
}

/// The model of the arm for other programs, as text: `"urdf"`, or `"mjcf"` for MuJoCo, where the parallelogram is a closed loop.
///
/// The same as `sevenbot model`. Lengths are metres and angles radians; a joint's angle is the register's angle less 90, 90, 65,
/// 90, 90, 90 degrees. The claw, joint 7, is left out.
#[pyfunction]
pub(crate) fn model(py: Python<'_>, format: &str) -> PyResult<String> {
    let text = match format {
        "urdf" => arm_model::urdf(),
        "mjcf" => arm_model::mjcf(),
        _ => return Err(InvalidValue::raise(py, &format!("format {format}: use \"urdf\" or \"mjcf\""))),
    };
    Ok(text?)
}
