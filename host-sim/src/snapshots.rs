//! Copies of an arm, kept by name until the simulator ends.

use std::collections::BTreeMap;

use embedded_storage::nor_flash::NorFlashErrorKind;

/// The most copies of an arm. Each takes a few KiB, and up to 32 KiB for its settings.
const SNAPSHOTS: usize = 64;
/// The longest name, in characters.
const LONGEST_NAME: usize = 64;

/// Why a snapshot is not kept or restored.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotRefusal {
    /// The name is empty or too long.
    #[error("the name does not have 1 to 64 characters")]
    Name,
    /// There is no room for another one.
    #[error("there are 64 snapshots")]
    Full,
    /// There is no snapshot with this name.
    #[error("there is no snapshot '{name}'{}", listed(others))]
    Unknown {
        /// The name that was asked for.
        name: String,
        /// The names of the snapshots that exist.
        others: Vec<String>,
    },
    /// The settings cannot be written.
    #[error("the settings cannot be written: {0}")]
    Settings(NorFlashErrorKind),
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { String::new() } else { format!("; there are: {}", names.join(", ")) }
}

impl SnapshotRefusal {
    /// What to do.
    #[must_use]
    pub const fn hint(&self) -> &'static str {
        match self {
            Self::Name => "a short word, as 'before'",
            Self::Full => "use the name of one of them, which is replaced",
            Self::Unknown { .. } => "`sevenbot sim snapshot NAME` keeps one, until the simulator ends",
            Self::Settings(_) => "is the file of --eeprom writable?",
        }
    }
}

/// Copies of an arm, by name.
#[derive(Debug)]
pub struct Snapshots<T>(BTreeMap<String, T>);

impl<T> Snapshots<T> {
    /// A store without copies.
    #[must_use]
    pub const fn new() -> Self {
        Self(BTreeMap::new())
    }

    /// Keeps a copy. It replaces a copy of the same name.
    ///
    /// # Errors
    /// The name is empty or too long, or there are 64 other copies.
    pub fn keep(&mut self, name: String, copy: T) -> Result<(), SnapshotRefusal> {
        if !(1..=LONGEST_NAME).contains(&name.chars().count()) {
            return Err(SnapshotRefusal::Name);
        }
        if self.0.len() >= SNAPSHOTS && !self.0.contains_key(&name) {
            return Err(SnapshotRefusal::Full);
        }
        self.0.insert(name, copy);
        Ok(())
    }

    /// The copy with this name.
    ///
    /// # Errors
    /// There is no copy with this name. The error lists the other names.
    pub fn get(&self, name: &str) -> Result<&T, SnapshotRefusal> {
        let unknown =
            || SnapshotRefusal::Unknown { name: name.to_owned(), others: self.0.keys().cloned().collect() };
        self.0.get(name).ok_or_else(unknown)
    }
}

impl<T> Default for Snapshots<T> {
    fn default() -> Self {
        Self::new()
    }
}
