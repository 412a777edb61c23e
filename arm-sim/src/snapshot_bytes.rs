//! A simulation as bytes, for a file or for another process.
//!
//! ```text
//!   ┌───────────┬────────────────────────────┬────────────────────┬─────────────────────┐
//!   │ "7BotSim" │ version, behind its length │ state, by postcard │ CRC-32 of these two │
//!   └───────────┴────────────────────────────┴────────────────────┴─────────────────────┘
//! ```
//!
//! The layout of the state follows the types of this version, so other versions refuse it. The checksum finds accidental damage
//! only: forged bytes can hold a state in which a step panics or never ends.

use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

use crc::{CRC_32_ISO_HDLC, Crc};

use crate::simulation::Simulation;

const MAGIC: &[u8] = b"7BotSim";
const VERSION: &str = env!("CARGO_PKG_VERSION");
const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why bytes are not a simulation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotError {
    /// The bytes do not begin with `7BotSim`.
    #[error("these bytes are not a snapshot of a simulation")]
    NotASnapshot,
    /// Bytes are missing, changed or added.
    #[error("the snapshot is damaged")]
    Damaged,
    /// The bytes were made by another version, which can have other types.
    #[error("the snapshot was made by version {made_by}, and this is version {VERSION}: take a new one")]
    OtherVersion {
        /// The version that made the bytes.
        made_by: String,
    },
}

impl Simulation {
    /// The simulation as bytes. Like a copy, they hold no recorder and no tap.
    ///
    /// ```
    /// use arm_sim::{Duration, Simulation};
    ///
    /// let mut arm = Simulation::default();
    /// arm.advance(Duration::from_millis(300));
    /// let other = Simulation::from_bytes(&arm.to_bytes())?;
    /// assert_eq!(other.now(), arm.now());
    /// # Ok::<(), arm_sim::snapshot_bytes::SnapshotError>(())
    /// ```
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        // postcard does not fail: a vector has room for all bytes, and each sequence in the state knows its length.
        sealed(&postcard::to_extend(&(VERSION, self), Vec::new()).unwrap_or_default())
    }

    /// Decodes the bytes of [`Simulation::to_bytes`]. They have to come from a trusted source.
    ///
    /// # Errors
    /// The bytes are damaged, were made by another version, or are not a snapshot.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SnapshotError> {
        let (version, state) = postcard::take_from_bytes::<&str>(content(bytes)?).map_err(damaged)?;
        if version != VERSION {
            return Err(SnapshotError::OtherVersion { made_by: version.to_owned() });
        }
        match postcard::take_from_bytes(state).map_err(damaged)? {
            (simulation, []) => Ok(simulation),
            _ => Err(SnapshotError::Damaged),
        }
    }
}

fn damaged(_: postcard::Error) -> SnapshotError {
    SnapshotError::Damaged
}

/// Puts version and state between the magic and the checksum.
fn sealed(content: &[u8]) -> Vec<u8> {
    [MAGIC, content, &CHECKSUM.checksum(content).to_le_bytes()].concat()
}

/// Checks magic and checksum, and returns the bytes between them: the inverse of [`sealed`].
fn content(bytes: &[u8]) -> Result<&[u8], SnapshotError> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(SnapshotError::NotASnapshot)?;
    match rest.split_last_chunk() {
        Some((content, sum)) if CHECKSUM.checksum(content).to_le_bytes() == *sum => Ok(content),
        _ => Err(SnapshotError::Damaged),
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn another_version_is_named() {
        let bytes = sealed(&postcard::to_extend(&("2.9.0", "another layout"), Vec::new()).unwrap());
        let error = Simulation::from_bytes(&bytes).unwrap_err();
        let expected =
            format!("the snapshot was made by version 2.9.0, and this is version {VERSION}: take a new one");
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn bytes_behind_the_state_are_damage() {
        let bytes = Simulation::default().to_bytes();
        let longer = sealed(&[content(&bytes).unwrap(), &[0]].concat());
        assert_eq!(Simulation::from_bytes(&longer).unwrap_err(), SnapshotError::Damaged);
    }

    #[test]
    fn each_missing_end_is_refused() {
        let bytes = Simulation::default().to_bytes();
        for end in 0..bytes.len() {
            let error = Simulation::from_bytes(&bytes[..end]).unwrap_err();
            let is_too_short = end < MAGIC.len();
            assert_eq!(error == SnapshotError::NotASnapshot, is_too_short, "{end}: {error}");
        }
    }

    proptest! {
        #[test]
        fn damage_is_refused(changes in vec((any::<prop::sample::Index>(), 1_u8..), 1..4)) {
            let bytes = Simulation::default().to_bytes();
            let mut changed = bytes.clone();
            for (at, bits) in changes {
                *at.get_mut(&mut changed) ^= bits;
            }
            prop_assert!(changed == bytes || Simulation::from_bytes(&changed).is_err());
        }

        #[test]
        fn no_bytes_panic(bytes in vec(any::<u8>(), 0..200), version in any::<bool>()) {
            prop_assert!(Simulation::from_bytes(&bytes).is_err());
            let head = postcard::to_extend(VERSION, Vec::new()).unwrap_or_default();
            let head = if version { head } else { Vec::new() };
            prop_assert!(Simulation::from_bytes(&sealed(&[head, bytes].concat())).is_err());
        }

        /// The checksum fits the changed state, so that the state is decoded.
        #[test]
        fn no_changed_state_panics_while_it_is_loaded(at in any::<prop::sample::Index>(), value in any::<u8>()) {
            let bytes = Simulation::default().to_bytes();
            let mut changed = content(&bytes).unwrap().to_vec();
            *at.get_mut(&mut changed) = value;
            let _ = Simulation::from_bytes(&sealed(&changed));
        }
    }
}
