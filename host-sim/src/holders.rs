//! Who has a terminal open at this moment, by looking at the open files of all processes. Slow, and therefore only
//! for when inotify has lost count. Linux only.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

/// Has anybody `terminal` open besides the simulator, which has it open once? True where the system does not tell.
pub(crate) fn has_other_holder(terminal: &Path) -> bool {
    let Ok(processes) = fs::read_dir("/proc") else { return true };
    // "self" stands for a process that has its number there as well.
    let is_number = |name: &OsStr| name.as_encoded_bytes().iter().all(u8::is_ascii_digit);
    let numbered = processes.flatten().filter(|entry| is_number(&entry.file_name()));
    let folders = numbered.map(|process| process.path().join("fd"));
    // Other users' processes do not show their files; nor can they open the port.
    let open_files = folders.filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let targets = open_files.filter_map(|file| fs::read_link(file.path()).ok());
    targets.filter(|target| target == terminal).nth(1).is_some()
}
