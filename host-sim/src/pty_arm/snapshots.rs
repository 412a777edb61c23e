//! Copies of an arm, kept by name until the simulator ends.

use arm_sim::controller::ArmController;
use arm_sim::faults::FaultReport;
use arm_sim::plant::Plant;
use arm_sim::simulated_arm::SimulatedArm;
use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind};
use protocol_core::time::Instant;

use super::PtyArm;

/// Copies of an arm. Each has about 20 KiB.
const SNAPSHOTS: usize = 64;
/// The longest name, in characters.
const LONGEST_NAME: usize = 64;

/// A copy of an arm.
#[derive(Debug)]
pub(super) struct Snapshot<F, B, C> {
    simulation: SimulatedArm<F, B, C>,
    ended_faults: Vec<FaultReport>,
}

/// Why a snapshot is not kept or restored.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotError {
    /// The name is empty or too long.
    #[error("the name does not have 1 to 64 characters")]
    Name,
    /// There is no room for another one.
    #[error("there are 64 snapshots")]
    Full,
    /// There is no snapshot with this name.
    #[error("there is no snapshot '{name}'{}", listed(others))]
    Unknown {
        /// The name.
        name: String,
        /// The names that there are.
        others: Vec<String>,
    },
    /// The settings cannot be written.
    #[error("the settings cannot be written: {0}")]
    Settings(NorFlashErrorKind),
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { String::new() } else { format!("; there are: {}", names.join(", ")) }
}

impl SnapshotError {
    /// What to do.
    #[must_use]
    pub const fn hint(&self) -> &'static str {
        match self {
            Self::Name => "a short word, as 'before'",
            Self::Full => "use the name of one of them, which is replaced",
            Self::Unknown { .. } => {
                "{\"do\":\"snapshot\",\"name\":\"before\"} keeps one, until the simulator ends"
            }
            Self::Settings(_) => "is the file of --eeprom writable?",
        }
    }
}

impl<F: NorFlash + Clone, C: ArmController> PtyArm<F, Plant, C> {
    /// Keeps a copy of the arm. It replaces one of the same name.
    ///
    /// # Errors
    /// The name is wrong, or there are 64 others.
    pub fn keep_snapshot(&mut self, name: String) -> Result<(), SnapshotError> {
        if !(1..=LONGEST_NAME).contains(&name.chars().count()) {
            return Err(SnapshotError::Name);
        }
        if self.snapshots.len() >= SNAPSHOTS && !self.snapshots.contains_key(&name) {
            return Err(SnapshotError::Full);
        }
        let snapshot =
            Snapshot { simulation: self.simulation.clone(), ended_faults: self.ended_faults.clone() };
        self.snapshots.insert(name, snapshot);
        Ok(())
    }

    /// Sets the arm back to a copy. Returns the time of the copy.
    ///
    /// # Errors
    /// There is no such copy, or its settings cannot be written.
    pub fn restore_snapshot(&mut self, name: &str) -> Result<Instant, SnapshotError> {
        let Some(snapshot) = self.snapshots.get(name) else {
            let others = self.snapshots.keys().cloned().collect();
            return Err(SnapshotError::Unknown { name: name.to_owned(), others });
        };
        let restored = self.simulation.restore(&snapshot.simulation);
        restored.map_err(|error| SnapshotError::Settings(error.kind()))?;
        self.ended_faults.clone_from(&snapshot.ended_faults);
        Ok(self.simulation.now())
    }
}
