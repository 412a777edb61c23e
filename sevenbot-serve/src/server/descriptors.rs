//! File descriptors: connections leave enough of them for the arm's port, which is opened again after each outage.

/// Connections of each kind, if there are enough descriptors: programs over the network, connections that have not shown their
/// token, and programs at the Unix socket.
const MOST: usize = 64;
/// Descriptors that one of each kind takes: over the network the socket and its [`super::breakage::Breakage`].
#[cfg(unix)]
const OF_EACH_KIND: usize = 2 + 2 + 1;
/// For the arm's port, for files, and for connections that are accepted only to be closed.
#[cfg(unix)]
const RESERVED: usize = 16;

/// How many connections of each kind the server may have. Call it when all listeners are open, and the arm's port is not.
#[cfg(unix)]
pub(super) fn connections() -> usize {
    use rustix::process::{Resource, getrlimit};
    let Some(limit) = getrlimit(Resource::Nofile).current.and_then(|limit| usize::try_from(limit).ok())
    else {
        return MOST;
    };
    // Where the system does not list them, those of a server with many ways in.
    let open = std::fs::read_dir("/dev/fd").map_or(RESERVED, Iterator::count);
    (limit.saturating_sub(open + RESERVED) / OF_EACH_KIND).clamp(1, MOST)
}

/// Windows has no such limit.
#[cfg(not(unix))]
pub(super) const fn connections() -> usize {
    MOST
}
