//! Checks whether another process has a terminal open, by a search in the open files of all processes. The search is slow,
//! so it is used only after inotify has lost reports. Linux only.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

/// Does a file descriptor besides the program's own refer to `terminal`? True if the system does not show open files.
pub(crate) fn has_other_holder(terminal: &Path) -> bool {
    let Ok(processes) = fs::read_dir("/proc") else { return true };
    // Skip entries such as "self", which is a link to a numbered one.
    let is_number = |name: &OsStr| name.as_encoded_bytes().iter().all(u8::is_ascii_digit);
    let processes = processes.flatten().filter(|entry| is_number(&entry.file_name()));
    let folders = processes.map(|process| process.path().join("fd"));
    // The files of other users' processes are not visible. Of these users, only root can open the port.
    let open_files = folders.filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let targets = open_files.filter_map(|file| fs::read_link(file.path()).ok());
    targets.filter(|target| target == terminal).nth(1).is_some()
}
