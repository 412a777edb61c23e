//! Where the control sockets are: by default in `$XDG_RUNTIME_DIR/7bot`, or else in the state directory.
//!
//! `sevenbot sim` searches the same directories. The default name of a socket contains the process id, so that each simulator
//! has its own.

use std::fs::{self, DirBuilder};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use rustix::io::Errno;
use rustix::process::{Pid, test_kill_process};

/// The start of a default name; the process id follows.
const PREFIX: &str = "control-";
/// The end of a default name.
const SUFFIX: &str = ".sock";

/// The directory of the default sockets. By the XDG base directory specification, a relative path counts as unset.
#[must_use]
pub fn directory(variable: impl Fn(&str) -> Option<PathBuf>) -> Option<PathBuf> {
    let absolute = |name| variable(name).filter(|path| path.is_absolute());
    let runtime = absolute("XDG_RUNTIME_DIR").or_else(|| absolute("XDG_STATE_HOME"));
    Some(runtime.or_else(|| Some(absolute("HOME")?.join(".local/state")))?.join("7bot"))
}

/// The default path of this process. Creates the directory, and removes the sockets of simulators that were killed.
///
/// # Errors
/// The environment names no directory, or the directory cannot be created.
pub fn default() -> io::Result<PathBuf> {
    let found = directory(|name| std::env::var_os(name).map(PathBuf::from));
    let directory = found.ok_or_else(|| io::Error::other("neither XDG_RUNTIME_DIR nor HOME is set"))?;
    let created = DirBuilder::new().recursive(true).mode(0o700).create(&directory);
    created.map_err(|cause| io::Error::other(format!("{}: {cause}", directory.display())))?;
    remove_left_ones(&directory);
    Ok(directory.join(format!("{PREFIX}{}{SUFFIX}", std::process::id())))
}

fn remove_left_ones(directory: &Path) {
    let Ok(entries) = fs::read_dir(directory) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        if owner(&path).is_some_and(|owner| test_kill_process(owner) == Err(Errno::SRCH)) {
            // Another simulator may have removed the file already.
            let _ = fs::remove_file(path);
        }
    }
}

/// The process id in the name of a default socket.
fn owner(path: &Path) -> Option<Pid> {
    let name = path.file_name()?.to_str()?.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)?;
    let number = name.split_once('-').map_or(name, |(process, _arm)| process);
    Pid::from_raw(number.parse().ok().filter(|&number| number > 0)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sockets_of_processes_that_ended_are_removed() {
        let directory = tempfile::tempdir().unwrap();
        let mut ended = std::process::Command::new("true").spawn().unwrap();
        let number = ended.id();
        ended.wait().unwrap();
        let own = format!("control-{}.sock", std::process::id());
        for name in
            [&own, &format!("control-{number}.sock"), &format!("control-{number}-2.sock"), "other.sock"]
        {
            fs::write(directory.path().join(name), "").unwrap();
        }
        remove_left_ones(directory.path());
        let mut left: Vec<_> =
            fs::read_dir(directory.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, [own.as_str(), "other.sock"]);
    }

    #[test]
    fn the_directory_follows_the_environment() {
        let of = |set: &'static [(&str, &str)]| {
            directory(|name| set.iter().find(|(key, _)| *key == name).map(|(_, value)| PathBuf::from(value)))
        };
        assert_eq!(
            of(&[("XDG_RUNTIME_DIR", "/run/user/1"), ("HOME", "/h")]),
            Some("/run/user/1/7bot".into())
        );
        assert_eq!(of(&[("XDG_RUNTIME_DIR", "relative"), ("XDG_STATE_HOME", "/s")]), Some("/s/7bot".into()));
        assert_eq!(of(&[("HOME", "/h")]), Some("/h/.local/state/7bot".into()));
        assert_eq!(of(&[]), None);
    }
}
