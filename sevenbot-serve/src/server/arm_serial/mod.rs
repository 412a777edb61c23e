//! The open serial port of the arm. Reads and writes do not wait: on Linux they use its descriptor, elsewhere a thread.

#[cfg(target_os = "linux")]
mod descriptor;
// The tests use this module on Linux, too.
#[cfg(any(test, not(target_os = "linux")))]
mod threads;

#[cfg(target_os = "linux")]
pub(super) use descriptor::ArmSerial;
#[cfg(not(target_os = "linux"))]
pub(super) use threads::ArmSerial;
