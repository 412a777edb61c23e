//! The park poses that users chose for their arms: a file of the user, with a line for each arm.
//!
//! ```text
//!   AB46DBA59495 _ 90 0 90 48.5 _ _       chip id, then joints 1 to 7 in degrees; _ stays as it is
//! ```
//!
//! `$XDG_CONFIG_HOME/7bot/park-poses`, or `~/.config/7bot/park-poses`; on Windows `%APPDATA%\7bot\park-poses`.

use std::env;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::fine_angle::FineAngle;
use crate::fine_state::FineTargets;
use crate::whole_file;

/// Why there is no place for the file, and what to do.
pub const NO_DIRECTORY: &str = if cfg!(windows) {
    "this user has no directory for settings: set APPDATA"
} else {
    "this user has no directory for settings: set HOME"
};

/// Where the file is; `None` if the user has no directory for settings.
#[must_use]
pub fn path() -> Option<PathBuf> {
    let set = |name| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let home = || set("HOME").map(|home| home.join(".config"));
    let directory = if cfg!(windows) { set("APPDATA") } else { set("XDG_CONFIG_HOME").or_else(home) };
    Some(directory?.join("7bot").join("park-poses"))
}

/// The pose of the arm with this chip id; `None` if none is kept.
///
/// # Errors
/// The file cannot be read, or the arm's line is no pose.
pub fn load(path: &Path, chip: &str) -> io::Result<Option<FineTargets>> {
    let text = match fs::read_to_string(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        read => read?,
    };
    let line = text.lines().find_map(|line| line.strip_prefix(chip)?.strip_prefix(' '));
    line.map(|line| parse(line).ok_or_else(|| io::Error::new(ErrorKind::InvalidData, "no pose"))).transpose()
}

/// Keeps a pose for the arm with this chip id, in the place of an earlier one.
///
/// # Errors
/// The file cannot be read or written.
pub fn keep(path: &Path, chip: &str, pose: &FineTargets) -> io::Result<()> {
    let text = match fs::read_to_string(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
        read => read?,
    };
    let mut lines: Vec<String> =
        text.lines().filter(|line| !line.starts_with(chip)).map(str::to_owned).collect();
    lines.push(format!("{chip} {}", text_of(pose)));
    if let Some(directory) = path.parent() {
        fs::create_dir_all(directory)?;
    }
    whole_file::write(path, (lines.join("\n") + "\n").as_bytes())
}

fn parse(line: &str) -> Option<FineTargets> {
    let joint = |word: &str| if word == "_" { Some(None) } else { word.parse::<FineAngle>().ok().map(Some) };
    let joints: Option<Vec<_>> = line.split_whitespace().map(joint).collect();
    joints?.try_into().ok()
}

fn text_of(pose: &FineTargets) -> String {
    let joint = |angle: &Option<FineAngle>| {
        angle.map_or_else(|| "_".to_owned(), |angle| format!("{:.2}", angle.degrees()))
    };
    pose.iter().map(joint).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_kept_for_its_arm_only() {
        let directory = tempfile::tempdir().expect("a folder");
        let path = directory.path().join("7bot").join("park-poses");
        assert!(matches!(load(&path, "AB"), Ok(None)));
        let pose =
            [None, FineAngle::from_degrees(90.25), None, None, None, None, FineAngle::from_degrees(0.0)];
        let other = [FineAngle::from_degrees(10.0); 7];
        keep(&path, "AB", &other).expect("a file");
        keep(&path, "CD", &other).expect("a file");
        keep(&path, "AB", &pose).expect("a file");
        assert_eq!(load(&path, "AB").expect("a file"), Some(pose));
        assert_eq!(load(&path, "CD").expect("a file"), Some(other));
        fs::write(&path, "AB 1 2 3\n").expect("a file");
        assert!(load(&path, "AB").is_err());
    }
}
