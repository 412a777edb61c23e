//! Defines where the arm's serial port is, and chooses the port to try after the arm was unplugged.
//!
//! An adapter that is plugged in again may get another name. Ports that were there all the time belong to other
//! devices, and are not opened: opening a port restarts some of them.

use std::path::{Path, PathBuf};

/// Where the arm's serial port is.
#[derive(Clone, Debug)]
pub enum ArmLocation {
    /// This port, whatever arm is behind it.
    Port(PathBuf),
    /// First this port. When the arm was lost, also the ports that were not there before; then it has to be the same
    /// arm, by its chip id.
    Search {
        /// The only port that is tried until the arm was found once.
        first: PathBuf,
        /// Lists all serial ports.
        list: fn() -> Vec<PathBuf>,
    },
}

/// Chooses the next port to try.
#[derive(Debug)]
pub(crate) struct PortSearch {
    list: fn() -> Vec<PathBuf>,
    /// Ports of other devices; `None` until the arm was found once.
    others: Option<Vec<PathBuf>>,
}

impl PortSearch {
    pub(crate) fn new(list: fn() -> Vec<PathBuf>) -> Self {
        Self { list, others: None }
    }

    /// Notes that the arm is behind `path`. So the other ports of this moment belong to other devices.
    pub(crate) fn found(&mut self, path: &Path) {
        let mut others = (self.list)();
        others.retain(|port| port != path);
        self.others = Some(others);
    }

    /// The port to try after `last`, in the order of the names; `None`: try `last` again.
    pub(crate) fn next(&mut self, last: &Path) -> Option<PathBuf> {
        let others = self.others.as_mut()?;
        let mut ports = (self.list)();
        others.retain(|port| ports.contains(port));
        ports.retain(|port| !others.contains(port));
        ports.sort();
        ports.iter().find(|port| port.as_path() > last).or_else(|| ports.first()).cloned()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;
    use std::sync::Mutex;

    static PORTS: Mutex<Vec<&str>> = Mutex::new(Vec::new());

    fn list() -> Vec<PathBuf> {
        PORTS.lock().unwrap().iter().map(PathBuf::from).collect()
    }

    #[test]
    fn ports_of_other_devices_are_not_tried() {
        let set = |ports: &[&'static str]| *PORTS.lock().unwrap() = ports.to_vec();
        let mut search = PortSearch::new(list);
        set(&["USB1", "USB0", "S0"]);
        assert_eq!(search.next(Path::new("USB0")), None, "the first port first");
        search.found(Path::new("USB0"));
        set(&["S0", "USB1"]);
        assert_eq!(search.next(Path::new("USB0")), None);
        set(&["USB2", "S0", "USB1", "USB0"]);
        assert_eq!(search.next(Path::new("USB0")), Some("USB2".into()));
        assert_eq!(search.next(Path::new("USB2")), Some("USB0".into()));
        set(&["S0"]);
        assert_eq!(search.next(Path::new("USB0")), None);
        set(&["S0", "USB1"]);
        assert_eq!(search.next(Path::new("USB0")), Some("USB1".into()), "it was unplugged, too");
    }
}
