//! Random sessions with a simulated arm, recorded and replayed. `cargo xtask replays` runs them natively and as a
//! WebAssembly module, and compares the results.

pub mod random_session;

use arm_sim::replay::Replay;
use crc::{CRC_64_XZ, Crc};

use random_session::random_session;

/// A checksum of the random session of this seed, with all its times and bytes.
// The lint is about symbols that clash at link time: the module is linked with nothing else.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn session_checksum(seed: u64) -> u64 {
    Crc::<u64>::new(&CRC_64_XZ).checksum(random_session(seed).as_bytes())
}

/// Records the random session of this seed, and replays it this many times. Returns how many replays are equal.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
#[must_use]
pub extern "C" fn equal_replays(seed: u64, times: u32) -> u32 {
    let session = random_session(seed);
    (0..times).map(|_| u32::from(Replay::run(&session).is_ok())).sum()
}
