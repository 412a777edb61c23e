//! The way to wait in tests: poll until something is true, and fail after a timeout.

use std::thread::sleep;
use std::time::{Duration, Instant};

/// The timeout of [`wait_for`], and of most reads from an arm. It is long, because the machine may be busy. For example, a
/// browser that draws one picture a second advances its simulated arm by only 0.1 s per picture.
pub const TIMEOUT: Duration = Duration::from_secs(180);
const POLL_PERIOD: Duration = Duration::from_millis(10);

/// Polls until there is a value, and returns it. After [`TIMEOUT`], panics with the error of the last poll.
#[track_caller]
pub fn wait_for<T>(event: &str, mut poll: impl FnMut() -> Result<T, String>) -> T {
    let deadline = Instant::now() + TIMEOUT;
    loop {
        match poll() {
            Ok(value) => return value,
            Err(state) => assert!(Instant::now() < deadline, "timeout: {event}: {state}"),
        }
        sleep(POLL_PERIOD);
    }
}

/// Polls until `holds` returns true. After [`TIMEOUT`], panics with `condition`.
#[track_caller]
pub fn wait_until(condition: &str, mut holds: impl FnMut() -> bool) {
    wait_for(condition, || if holds() { Ok(()) } else { Err("not yet".to_owned()) });
}
