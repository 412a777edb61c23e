//! The addresses of arms whose names were found on the network, or that the user entered: they work where multicast is blocked.
//!
//! The file `names` of the state directory has a line for each, such as `lab-3 tls://10.0.0.5:7777`.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;

use super::address::Address;
use super::directories::state_directory;
use crate::whole_file;

const FILE: &str = "names";
/// The largest number of names. The oldest ones are forgotten first.
const MOST_NAMES: usize = 256;

/// Why there is no place for the file.
const NO_DIRECTORY: &str = if cfg!(unix) {
    "there is no state directory that only this user can write to: set XDG_STATE_HOME to the path of a directory of your own"
} else {
    "names are remembered on Linux and macOS only"
};

/// A name, and the last known address of its arm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownName {
    /// The name, as in `sevenbot://NAME`.
    pub name: String,
    /// The address: TCP, or TLS with a certificate for the name.
    pub address: Address,
}

impl KnownName {
    fn parse(line: &str) -> Option<Self> {
        let (name, address) = line.trim().split_once(' ')?;
        let address = Address::parse(address.trim()).filter(Address::is_of_network)?;
        is_name(name).then(|| Self { name: name.to_owned(), address })
    }
}

/// The rule for the name of an arm, as advice to a user whose name breaks it.
pub const NAME_RULE: &str = "use 1 to 63 letters, digits and hyphens";

/// May an arm have this name? See [`NAME_RULE`].
#[must_use]
pub fn is_name(text: &str) -> bool {
    (1..=63).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
}

/// The names that are known, the newest last.
#[must_use]
pub fn known_names() -> Vec<KnownName> {
    state_directory().map(|directory| read(&directory.join(FILE))).unwrap_or_default()
}

/// Remembers the address of an arm. It replaces an earlier address of the same name.
///
/// # Errors
/// This user has no state directory that only they can write to, or the file cannot be written.
pub fn remember(known: &KnownName) -> io::Result<()> {
    change(|names| {
        names.retain(|other| other.name != known.name);
        names.push(known.clone());
    })
}

/// Forgets a name.
///
/// # Errors
/// As [`remember`].
pub fn forget(name: &str) -> io::Result<()> {
    change(|names| names.retain(|other| other.name != name))
}

fn read(file: &Path) -> Vec<KnownName> {
    fs::read_to_string(file).unwrap_or_default().lines().filter_map(KnownName::parse).collect()
}

fn change(change: impl FnOnce(&mut Vec<KnownName>)) -> io::Result<()> {
    let directory = state_directory().ok_or_else(|| io::Error::new(ErrorKind::NotFound, NO_DIRECTORY))?;
    let mut names = read(&directory.join(FILE));
    let before = names.clone();
    change(&mut names);
    if names == before { Ok(()) } else { write(&directory, &names) }
}

fn write(directory: &Path, names: &[KnownName]) -> io::Result<()> {
    let kept = names.get(names.len().saturating_sub(MOST_NAMES)..).unwrap_or_default();
    let text: String = kept.iter().map(|known| format!("{} {}\n", known.name, known.address)).collect();
    whole_file::write(&directory.join(FILE), text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_name_and_an_address_of_the_network() {
        let known = KnownName::parse("lab-3 tls://10.0.0.5:7777").expect("a name");
        assert_eq!(
            (known.name.as_str(), known.address.to_string().as_str()),
            ("lab-3", "tls://10.0.0.5:7777")
        );
        for line in [
            "",
            "lab-3",
            "lab-3 /dev/ttyUSB0",
            "lab-3 sevenbot://lab-4",
            "lab-3 unix:/run/a.sock",
            "a.b tcp://h:1",
        ] {
            assert_eq!(KnownName::parse(line), None, "{line}");
        }
    }

    #[test]
    fn what_was_written_is_read_and_the_oldest_go() {
        let directory = std::env::temp_dir().join(format!("sevenbot-names-{}", std::process::id()));
        fs::create_dir_all(&directory).expect("a directory");
        let name = |number: usize| {
            KnownName::parse(&format!("arm-{number} tcp://10.0.0.5:{number}")).expect("a name")
        };
        let names: Vec<_> = (1..=MOST_NAMES + 2).map(name).collect();
        write(&directory, &names).expect("written");
        assert_eq!(read(&directory.join(FILE)), names[2..]);
        fs::remove_dir_all(directory).expect("its end");
    }
}
