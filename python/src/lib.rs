//! The Python module of the library `sevenbot`.
//!
//! ```text
//!   Python thread ── call ──▶ Worker: the thread that owns the port ──▶ sevenbot::Arm
//!        ▲                        │
//!        └── releases the interpreter's lock while it waits, and checks signals each 50 ms
//! ```
//!
//! The thread of the port never takes the interpreter's lock. So Python code that computes does not delay the link.

#![deny(unsafe_code)]

use pyo3::prelude::*;

mod arguments;
mod arm;
mod arms;
mod arrays;
mod bulk;
mod errors;
mod geometry;
mod health;
mod latest;
mod lead;
mod motion;
mod numbers;
mod observation;
mod opening;
mod place;
mod ports;
mod progress;
mod recording;
mod registers;
mod simulation;
mod status;
mod stream;
mod stream_counts;
mod tip;
mod watch;
mod worker;

/// The compiled part of `sevenbot`.
#[pymodule]
fn _sevenbot(module: &Bound<'_, PyModule>) -> PyResult<()> {
    errors::register(module)?;
    errors::register_also(module)?;
    module.add_class::<arm::Arm>()?;
    module.add_class::<health::JointStatus>()?;
    module.add_class::<health::Problem>()?;
    module.add_class::<observation::Observation>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<registers::Registers>()?;
    module.add_class::<arm::SimulatedArm>()?;
    module.add_class::<arms::SimulatedArms>()?;
    module.add_class::<simulation::Simulation>()?;
    module.add_class::<simulation::SimulationSnapshot>()?;
    module.add_class::<status::Status>()?;
    module.add_class::<stream::Stream>()?;
    module.add_class::<stream_counts::StreamCounts>()?;
    module.add_class::<tip::Tip>()?;
    module.add_function(wrap_pyfunction!(geometry::forward, module)?)?;
    module.add_function(wrap_pyfunction!(geometry::inverse, module)?)?;
    module.add_function(wrap_pyfunction!(geometry::limits, module)?)?;
    module.add_function(wrap_pyfunction!(geometry::model, module)?)?;
    module.add_function(wrap_pyfunction!(ports::ports, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
