//! The servers of this user on this computer. Each has a file in a directory that only this user can write to, with lines such
//! as `port /dev/ttyUSB0`, and a Unix socket of the same name beside it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process;

use super::directories::runtime_directory;

/// The extension of a server's file.
const FILE: &str = "server";
/// The extension of a server's socket.
const SOCKET: &str = "sock";

/// A server of this user on this computer, as its file describes it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LocalServer {
    /// The path of its Unix socket, beside its file.
    pub socket: PathBuf,
    /// The serial port of its arm.
    pub port: PathBuf,
    /// The name of the server in `sevenbot://NAME`; `None` if it has no name.
    pub name: Option<String>,
}

/// The file of a server that runs. Dropping it removes the file.
#[derive(Debug)]
pub struct Registered(PathBuf);

impl Drop for Registered {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

impl LocalServer {
    /// The server of this process, with `port` still empty. `None` if there is no directory for its files.
    #[must_use]
    pub fn of_this_process(name: Option<String>) -> Option<Self> {
        let socket = runtime_directory()?.join(format!("serve-{}.{SOCKET}", process::id()));
        Some(Self { socket, port: PathBuf::new(), name })
    }

    /// Announces the server to other programs of this user: writes its file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn register(&self) -> io::Result<Registered> {
        let path = self.socket.with_extension(FILE);
        let mut text =
            format!("port {}\n", fs::canonicalize(&self.port).as_deref().unwrap_or(&self.port).display());
        if let Some(name) = &self.name {
            text.push_str(&format!("name {name}\n"));
        }
        // `create_new` fails if the file exists. A killed program with the same process id may have left it.
        let _ = fs::remove_file(&path);
        let mut file = fs::File::create_new(&path)?;
        io::Write::write_all(&mut file, text.as_bytes())?;
        Ok(Registered(path))
    }

    fn read(file: &Path) -> Option<Self> {
        let text = fs::read_to_string(file).ok()?;
        let value = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(' '));
        let port = value("port")?.into();
        Some(Self { socket: file.with_extension(SOCKET), port, name: value("name").map(str::to_owned) })
    }

    /// Does the server accept connections? A killed server leaves its file behind.
    #[cfg(unix)]
    fn is_running(&self) -> bool {
        std::os::unix::net::UnixStream::connect(&self.socket).is_ok()
    }

    #[cfg(not(unix))]
    const fn is_running(&self) -> bool {
        false
    }

    /// The address of the server, for use in the place of a port's name.
    #[must_use]
    pub fn address(&self) -> String {
        format!("unix:{}", self.socket.display())
    }
}

/// The servers of this user that run.
#[must_use]
pub fn servers() -> Vec<LocalServer> {
    let entries = runtime_directory().and_then(|directory| fs::read_dir(directory).ok());
    let files = entries.into_iter().flatten().flatten().map(|entry| entry.path());
    let files = files.filter(|path| path.extension().is_some_and(|extension| extension == FILE));
    let mut found: Vec<_> =
        files.filter_map(|file| LocalServer::read(&file)).filter(LocalServer::is_running).collect();
    found.sort_by(|one, other| one.socket.cmp(&other.socket));
    found
}

/// The running server of this user that has this port open; `None` if there is none.
#[must_use]
pub fn serving(port: &str) -> Option<LocalServer> {
    let port = fs::canonicalize(port).ok()?;
    servers().into_iter().find(|server| server.port == port)
}
