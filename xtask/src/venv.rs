//! Virtual environments of Python, which are kept for the next run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::run::{TaskResult, run_command};

/// Installs packages as pip does, but asks PyPI for many of them at once. A version that was tried.
const INSTALLER: &str = "uv==0.13.9";

/// The Python of an environment in `folder` with these packages from PyPI. It is made anew, with the interpreter that `program`
/// finds, if it does not work or the list has changed.
pub(crate) fn with_packages(
    folder: &Path,
    program: impl FnOnce() -> TaskResult<PathBuf>,
    packages: &[&str],
) -> TaskResult<PathBuf> {
    let (python, installed) = (folder.join("bin/python"), folder.join("packages.txt"));
    let list = packages.join("\n");
    if fs::read_to_string(&installed).is_ok_and(|text| text == list) && works(&python) {
        return Ok(python);
    }
    run_command(Command::new(program()?).args(["-m", "venv", "--clear"]).arg(folder))?;
    if !packages.is_empty() {
        run_command(pip(&python).arg(INSTALLER))?;
        let mut uv = Command::new(&python);
        run_command(uv.args(["-m", "uv", "pip", "install", "--quiet"]).args(packages))?;
    }
    fs::write(installed, list)?;
    Ok(python)
}

/// Is this the Python of an environment with pip?
fn works(python: &Path) -> bool {
    let mut pip = Command::new(python);
    pip.args(["-m", "pip", "--version"]).stdout(Stdio::null()).stderr(Stdio::null());
    pip.status().is_ok_and(|status| status.success())
}

/// `pip install`.
pub(crate) fn pip(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    command
}
