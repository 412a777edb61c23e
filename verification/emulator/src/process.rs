//! Child processes, waits and errors of the tasks that run the emulator.

use std::error::Error;
use std::process::Child;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The result of a task. The text of the error is printed for the user.
pub type TaskResult<T = ()> = Result<T, Box<dyn Error>>;

/// The timeout of [`wait_for`] and of a read from the emulator's sockets. It is long, because the machine may be busy.
pub const TIMEOUT: Duration = Duration::from_secs(60);

/// Polls until there is a value.
///
/// # Errors
/// A timeout, or the error of a poll.
pub fn wait_for<T>(event: &str, mut poll: impl FnMut() -> TaskResult<Option<T>>) -> TaskResult<T> {
    let deadline = Instant::now() + TIMEOUT;
    while Instant::now() < deadline {
        if let Some(value) = poll()? {
            return Ok(value);
        }
        sleep(Duration::from_millis(5));
    }
    Err(format!("timeout: {event}"))?
}

/// A child process that is killed when it is dropped.
#[derive(Debug)]
pub struct ChildProcess(pub Child);

impl Drop for ChildProcess {
    fn drop(&mut self) {
        // An error means that the process has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
