//! File descriptors: connections leave enough of them for the arm's port, which is opened again after each outage.

use super::admission::Places;

/// Connections of each kind, if there are enough descriptors: programs over the network, connections that have not shown their
/// token, and programs at the Unix socket.
const MOST: usize = 64;
/// Descriptors that one of each kind takes: over the network the socket and its [`super::breakage::Breakage`].
const OF_EACH_KIND: usize = 2 + 2 + 1;
/// Descriptors for the arm's port, for files, and for connections that are accepted only to be closed.
#[cfg(unix)]
const RESERVED: usize = 16;

/// Enough descriptors for a class with all its tabs. Some systems allow a process 256, and more if it asks.
#[cfg(unix)]
const WANTED: u64 = 2_048;
/// Descriptors of a connection over the network.
const OF_CONNECTION: usize = 2;

/// Asks the system for more descriptors. If the system refuses, there are fewer places.
#[cfg(unix)]
pub(super) fn ask_for_more() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let wanted = limit.maximum.map_or(WANTED, |maximum| maximum.min(WANTED));
    if limit.current.is_some_and(|current| current < wanted) {
        let _ = setrlimit(Resource::Nofile, Rlimit { current: Some(wanted), ..limit });
    }
}

/// Windows has no such limit.
#[cfg(not(unix))]
pub(super) const fn ask_for_more() {}

/// How many connections of each kind the server may have. Call it when all listeners are open, and the arm's port is not.
pub(super) fn connections() -> usize {
    (free() / OF_EACH_KIND).clamp(1, MOST)
}

/// The places of a class, reduced to what the free descriptors allow beside the programs at the Unix socket.
pub(super) fn fitting(places: Places) -> Places {
    fitting_in(places, free().saturating_sub(connections()))
}

fn fitting_in(places: Places, descriptors: usize) -> Places {
    let most = descriptors / OF_CONNECTION;
    let clients = places.clients.min(most / 2).max(1);
    let unknown = places.unknown.min(most.saturating_sub(clients + places.reserved)).max(1);
    Places { clients, unknown, ..places }
}

/// Descriptors that are free for connections.
#[cfg(unix)]
fn free() -> usize {
    use rustix::process::{Resource, getrlimit};
    let Some(limit) = getrlimit(Resource::Nofile).current.and_then(|limit| usize::try_from(limit).ok())
    else {
        return usize::MAX;
    };
    // If the system does not list the open descriptors, assume those of a server with all its listeners.
    let open = std::fs::read_dir("/dev/fd").map_or(RESERVED, Iterator::count);
    limit.saturating_sub(open + RESERVED)
}

/// Windows has no such limit.
#[cfg(not(unix))]
const fn free() -> usize {
    usize::MAX
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_class_has_as_many_places_as_there_are_descriptors() {
        let places = Places { clients: 72, reserved: 8, unknown: 256 };
        let fitting = |descriptors| {
            let Places { clients, reserved, unknown } = fitting_in(places, descriptors);
            [clients, reserved, unknown]
        };
        assert_eq!(fitting(2_000), [72, 8, 256]);
        assert_eq!(fitting(183), [45, 8, 38], "the pupils, and not all connections of their browsers");
        assert_eq!(fitting(0), [1, 8, 1]);
    }
}
