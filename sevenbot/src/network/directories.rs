//! The directories of this user for files that other users must not write to.

use std::env;
use std::path::{Path, PathBuf};

/// The directory of the servers' files: `7bot` in `XDG_RUNTIME_DIR`, otherwise in [`state_base`]. `None` if neither is known, if
/// it cannot be created, if it belongs to another user, if others can write there, or if the system is not Unix.
pub(super) fn runtime_directory() -> Option<PathBuf> {
    private(absolute("XDG_RUNTIME_DIR").or_else(state_base)?)
}

/// The directory for files that outlive the session: `7bot` in [`state_base`]. `None` as for [`runtime_directory`].
pub(super) fn state_directory() -> Option<PathBuf> {
    private(state_base()?)
}

/// `XDG_STATE_HOME`, or `~/.local/state`; `None` if neither is an absolute path.
fn state_base() -> Option<PathBuf> {
    absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")))
}

fn absolute(variable: &str) -> Option<PathBuf> {
    env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute())
}

fn private(base: PathBuf) -> Option<PathBuf> {
    let directory = base.join("7bot");
    is_private(&directory).then_some(directory)
}

/// Is this a directory that only this user can write to? Creates it if it does not exist.
#[cfg(unix)]
fn is_private(directory: &Path) -> bool {
    use std::fs;
    use std::os::unix::fs::{DirBuilderExt, MetadataExt};
    let _ = fs::DirBuilder::new().recursive(true).mode(0o700).create(directory);
    // On Linux the owner of /proc/self is this user. On systems without it the owner is not checked.
    let user = fs::metadata("/proc/self").map(|shown| shown.uid()).ok();
    fs::symlink_metadata(directory).is_ok_and(|found| {
        let is_ours = user.is_none_or(|user| user == found.uid());
        found.is_dir() && is_ours && found.mode() & 0o022 == 0
    })
}

#[cfg(not(unix))]
const fn is_private(_: &Path) -> bool {
    false
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::{fs, process};

    #[test]
    fn a_directory_that_others_can_write_to_is_not_used() {
        use std::os::unix::fs::PermissionsExt;
        let directory = env::temp_dir().join(format!("sevenbot-private-{}", process::id()));
        assert!(is_private(&directory));
        fs::set_permissions(&directory, fs::Permissions::from_mode(0o777)).expect("permissions");
        assert!(!is_private(&directory));
        let link = directory.join("link");
        std::os::unix::fs::symlink(env::temp_dir(), &link).expect("a link");
        assert!(!is_private(&link));
        fs::remove_dir_all(directory).expect("its end");
    }
}
