//! How many arms a process may have.

use std::sync::atomic::{AtomicUsize, Ordering};

use pyo3::prelude::*;

use crate::errors::{PortError, error};

/// The most open arms of a process. Each arm has a thread with four memory mappings, and Linux allows a process 65,530 of them.
const MOST_ARMS: usize = 8_192;
/// The number of open arms of this process.
static OPEN_ARMS: AtomicUsize = AtomicUsize::new(0);

/// The right to one of [`MOST_ARMS`] arms. Dropping it frees the place.
pub(crate) struct ArmPlace;

impl ArmPlace {
    pub(crate) fn take(py: Python<'_>) -> PyResult<Self> {
        let place = Self;
        if OPEN_ARMS.fetch_add(1, Ordering::Relaxed) < MOST_ARMS {
            return Ok(place);
        }
        Err(no_thread(py, &format!("{MOST_ARMS} are open already")))
    }
}

impl Drop for ArmPlace {
    fn drop(&mut self) {
        OPEN_ARMS.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The exception of an arm that gets no thread.
pub(crate) fn no_thread(py: Python<'_>, why: &str) -> PyErr {
    let hint = "close the arms that are no longer used: `arm.close()`, or `with`".to_owned();
    error::<PortError>(py, &format!("there is no thread for another arm: {why}"), &[hint])
}
