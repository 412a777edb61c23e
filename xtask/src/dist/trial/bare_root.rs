//! A minimal Debian with Python: made once with mmdebstrap, and unpacked for each use.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use crate::run::{TaskResult, run_command, target_directory};

/// The release of Debian.
const SUITE: &str = "bookworm";
/// The package that a user of Python has installed.
const PYTHON: &str = "--include=python3-venv";
/// Enters the folder `$1` and runs the script `$2` there.
const ENTER: &str = "mount -t proc proc \"$1/proc\" && mount --rbind /dev \"$1/dev\" && \
                     exec chroot \"$1\" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root \
                     /bin/sh -eu -c \"$2\"";

/// An unpacked system. Dropping it removes it.
pub(super) struct BareRoot(TempDir);

impl BareRoot {
    /// A freshly unpacked system with these files in its folder `/release`.
    pub(super) fn with(files: &[PathBuf]) -> TaskResult<Self> {
        let packed = packed()?;
        let folder = TempDir::new_in(directory())?;
        run_command(
            Command::new("tar")
                .args(["--extract", "--directory"])
                .arg(folder.path())
                .arg("--file")
                .arg(packed),
        )?;
        let release = folder.path().join("release");
        fs::create_dir(&release)?;
        for file in files {
            fs::copy(file, release.join(file.file_name().unwrap_or_default()))?;
        }
        Ok(Self(folder))
    }

    /// Runs a shell script in this system, in a folder where the script may write.
    pub(super) fn run(&self, script: &str) -> TaskResult {
        let mut command = Command::new("unshare");
        command.args(["--mount", "--pid", "--fork", "--kill-child", "sh", "-c", ENTER, "sh"]);
        run_command(command.arg(self.0.path()).arg(format!("cd /root\n{script}")))
            .map_err(|_| "the installed programs failed, see above".into())
    }
}

fn directory() -> PathBuf {
    target_directory().join("dist-roots")
}

/// The packed system. It is kept for the next run.
fn packed() -> TaskResult<PathBuf> {
    make(&directory().join("debian.tar"), &["--variant=minbase", PYTHON])
}

/// Makes a packed system with these options of mmdebstrap, unless `path` exists. Needs root.
pub(super) fn make(path: &Path, options: &[&str]) -> TaskResult<PathBuf> {
    if !rustix::process::geteuid().is_root() {
        return Err("a bare Debian is made and entered by root only: run this step as root".into());
    }
    if !path.exists() {
        fs::create_dir_all(directory())?;
        let part = path.with_extension("part.tar");
        run_command(Command::new("mmdebstrap").arg("--quiet").args(options).arg(SUITE).arg(&part))?;
        fs::rename(part, path)?;
    }
    Ok(path.to_owned())
}
