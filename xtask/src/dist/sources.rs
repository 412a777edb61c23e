//! A copy of the sources, for tools that write beside them or need a changed line.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::run::{TaskResult, empty_folder, root, run_command};

/// Copies the files that git knows, as they are now. A folder that exists is replaced.
pub(super) fn copy(copy: &Path) -> TaskResult {
    empty_folder(copy)?;
    let mut list = Command::new("git");
    let mut list = list.args(["ls-files", "-z"]).current_dir(root()).stdout(Stdio::piped()).spawn()?;
    let files = list.stdout.take().ok_or("git has no output")?;
    let mut pack = Command::new("tar");
    pack.args(["--create", "--null", "--files-from=-"])
        .current_dir(root())
        .stdin(files)
        .stdout(Stdio::piped());
    let mut pack = pack.spawn()?;
    let packed = pack.stdout.take().ok_or("tar has no output")?;
    run_command(Command::new("tar").args(["--extract", "--directory"]).arg(copy).stdin(packed))?;
    if list.wait()?.success() && pack.wait()?.success() {
        Ok(())
    } else {
        Err("the sources cannot be copied".into())
    }
}
