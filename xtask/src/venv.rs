//! The interpreters of Python on this computer, and virtual environments, which are kept for the next run.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

use crate::run::{TaskResult, run_command};

/// The program that installs the packages, at a version that was tried. It asks PyPI for many packages at once, unlike pip.
const INSTALLER: &str = "uv==0.13.9";

/// Programs to look for on PATH.
const INTERPRETERS: [&str; 6] =
    ["python3", "python3.11", "python3.12", "python3.13", "python3.10", "python3.14"];
/// Prints the version.
const VERSION: &str = "import sys; print(*sys.version_info[:2])";

/// A version of Python, such as 3 and 11.
pub(crate) type Version = (u8, u8);

/// The versions on PATH, each with a program.
pub(crate) fn on_path() -> Vec<(Version, PathBuf)> {
    with_versions(INTERPRETERS.into_iter().map(PathBuf::from))
}

/// The versions on PATH and in pyenv, each with a program.
pub(crate) fn of_this_computer() -> Vec<(Version, PathBuf)> {
    let home = env::var_os("PYENV_ROOT").map(PathBuf::from);
    let home = home.or_else(|| env::home_dir().map(|home| home.join(".pyenv")));
    let of_pyenv = home.and_then(|home| fs::read_dir(home.join("versions")).ok());
    let of_pyenv = of_pyenv.into_iter().flatten().flatten().map(|version| version.path().join("bin/python3"));
    with_versions(INTERPRETERS.into_iter().map(PathBuf::from).chain(of_pyenv))
}

/// An interpreter of one of these versions. `what` names its user in the error.
pub(crate) fn interpreter(what: &str, versions: RangeInclusive<Version>) -> TaskResult<PathBuf> {
    let found = of_this_computer().into_iter().find(|(version, _)| versions.contains(version));
    let ((major, first), (_, last)) = versions.into_inner();
    let none = || {
        format!("{what} needs Python {major}.{first} to {major}.{last}: neither PATH nor pyenv has one")
            .into()
    };
    found.map(|(_, program)| program).ok_or_else(none)
}

/// The programs that are Python interpreters, with their versions. Of several programs with the same version, only the first.
fn with_versions(programs: impl Iterator<Item = PathBuf>) -> Vec<(Version, PathBuf)> {
    let mut found: Vec<(Version, PathBuf)> = Vec::new();
    for program in programs {
        let output = Command::new(&program).args(["-c", VERSION]).stderr(Stdio::null()).output();
        let text =
            output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
        let version = text
            .trim()
            .split_once(' ')
            .and_then(|(major, minor)| Some((major.parse().ok()?, minor.parse().ok()?)));
        if let Some(version) = version
            && found.iter().all(|(other, _)| *other != version)
        {
            found.push((version, program));
        }
    }
    found
}

/// The Python of an environment in `folder` with these packages from PyPI. If the environment does not work, or the list has
/// changed, the environment is made anew with the interpreter that `program` finds.
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

/// The command that installs packages, which the caller adds.
pub(crate) fn pip(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    command
}
