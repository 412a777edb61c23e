//! The open serial port of the arm, which never waits: on Linux by its descriptor, elsewhere by a thread.

#[cfg(target_os = "linux")]
mod descriptor;
// The tests use this module on Linux, too.
#[cfg(any(test, not(target_os = "linux")))]
mod threads;

#[cfg(target_os = "linux")]
pub(super) use descriptor::ArmSerial;
#[cfg(not(target_os = "linux"))]
pub(super) use threads::ArmSerial;
