//! Serial ports, and which of them lead to an arm.

use pyo3::prelude::*;
use sevenbot::ports::{available, probe};

use crate::errors::{PortError, error};

/// The serial ports of this machine with an arm: name, description, device id (register 11) and firmware version.
///
/// Asks all ports at the same time, at `baud` bits per second, for about half a second.
#[pyfunction]
#[pyo3(signature = (baud = 115_200))]
pub(crate) fn ports(py: Python<'_>, baud: u32) -> Vec<(String, String, u8, String)> {
    let found = py.detach(|| probe(available(), baud));
    let arms = found.into_iter().filter_map(|found| {
        let (identity, id) = found.answer.ok()?;
        Some((found.port.name, found.port.description, id, identity.version()))
    });
    arms.collect()
}

/// The name of the only port with an arm.
pub(crate) fn only_one(py: Python<'_>, baud: u32) -> PyResult<String> {
    let found = ports(py, baud);
    match found.as_slice() {
        [(name, ..)] => Ok(name.clone()),
        [] => {
            let hints = [
                "is the arm plugged in, and has it power? A simulator's port has to be named",
                "is the baud rate right (baud=)?",
                "`sevenbot ports` lists the ports",
            ];
            Err(error::<PortError>(py, "no port has an arm that answers", &hints.map(str::to_owned)))
        }
        several => {
            let names: Vec<_> = several.iter().map(|(name, ..)| name.as_str()).collect();
            let message = format!("several arms answer: {}", names.join(", "));
            Err(error::<PortError>(py, &message, &["name one of these ports".to_owned()]))
        }
    }
}
