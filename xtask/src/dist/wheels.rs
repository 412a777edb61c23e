//! The Python packages: the module as a wheel for each system and as source, the plugin for LeRobot, and the node of ROS.

use std::fs;
use std::process::Command;

use super::platform::{LINUX_AARCH64, PLATFORMS, PROFILE, Platform, build_directory, reproducible};
use super::release::Release;
use super::tools;
use crate::python::copy_of;
use crate::run::{TaskResult, root, run_command};

/// The packages without compiled code: their folder, and their name.
const PURE: [(&str, &str); 2] =
    [("python/lerobot", "lerobot_robot_sevenbot"), ("ros/sevenbot_ros", "sevenbot_ros")];

/// The name of the module's wheel.
pub(super) fn wheel(release: &Release, platform: Platform) -> String {
    release.name("sevenbot", &format!("-cp310-abi3-{}.whl", platform.wheel))
}

/// The name of the module's source.
pub(super) fn source(release: &Release) -> String {
    release.name("sevenbot", ".tar.gz")
}

pub(super) fn names(release: &Release) -> Vec<String> {
    let pure = PURE.map(|(_, name)| release.name(name, "-py3-none-any.whl"));
    let wheels = PLATFORMS.iter().map(|&platform| wheel(release, platform));
    wheels.chain(pure).chain([source(release)]).collect()
}

pub(super) fn write(release: &Release) -> TaskResult {
    for platform in PLATFORMS {
        write_wheel(release, platform)?;
    }
    let mut maturin = maturin(release, "sdist", LINUX_AARCH64.triple)?;
    run_command(&mut maturin)?;
    PURE.iter().try_for_each(|(folder, name)| write_pure(release, folder, name))
}

fn write_wheel(release: &Release, platform: Platform) -> TaskResult {
    let mut maturin = maturin(release, "build", platform.triple)?;
    maturin.args(["--quiet", "--locked", "--profile", PROFILE, "--target", platform.triple]);
    if platform.debian.is_some() {
        maturin.args(["--zig", "--compatibility", "manylinux2014"]);
        platform.use_zig(&mut maturin)?;
    }
    run_command(&mut maturin)
}

fn maturin(release: &Release, what: &str, triple: &str) -> TaskResult<Command> {
    let python = tools::python()?;
    let mut maturin = Command::new(&python);
    maturin.args(["-m", "maturin", what, "--manifest-path"]).arg(root().join("python/Cargo.toml"));
    maturin.arg("--out").arg(&release.folder).env("PATH", tools::search_path()?);
    reproducible(&mut maturin, release, triple)?;
    Ok(maturin)
}

/// setuptools leaves files beside the sources, so it gets a copy. The package may require a later version of
/// Python than the one that runs pip.
fn write_pure(release: &Release, folder: &str, name: &str) -> TaskResult {
    let copy = build_directory().join("python").join(name);
    fs::create_dir_all(build_directory().join("python"))?;
    copy_of(&root().join(folder), &copy)?;
    // A wheel keeps the permissions of its files. In a checkout they depend on the user's umask.
    run_command(Command::new("chmod").args(["-R", "u=rwX,go=rX"]).arg(&copy))?;
    let mut pip = Command::new(tools::python()?);
    pip.args(["-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]);
    pip.args(["--no-build-isolation", "--ignore-requires-python", "--wheel-dir"])
        .arg(&release.folder)
        .arg(copy);
    run_command(pip.env("SOURCE_DATE_EPOCH", release.epoch.to_string()))
}
