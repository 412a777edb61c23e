//! Tests the plugin for LeRobot with LeRobot's base classes alone, and with all of LeRobot.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::python::{copy_of, folder, wheel};
use crate::run::{TaskResult, build_host_sim, build_image, root, run_command};
use crate::venv::{self, interpreter, pip};

/// LeRobot, installed without its dependencies. They take some gigabytes, and the base classes need few of them.
const LEROBOT: &str = "lerobot==0.6.1";
/// The packages that the base classes import. The base classes use torch in annotations only, so the tests have an empty module
/// of this name.
const BASE_PACKAGES: [&str; 5] =
    ["draccus==0.11.6", "numpy==2.2.6", "huggingface-hub==1.33.0", "packaging==25.0", "tqdm==4.70.1"];
/// All of LeRobot that its commands for robots need.
const WHOLE: &str = "lerobot[core-scripts]==0.6.1";
/// The packages that run the tests and check the types.
const TEST_PACKAGES: [&str; 2] = ["pytest==9.2.0", "mypy==2.4.1"];
/// The free disk that the whole installation needs, in GiB: 3 for pip's downloads, and 6 for the installed packages.
const NEEDED_GIB: u64 = 9;
/// Checks types and behaviour of the plugin, with the base classes of LeRobot.
pub(crate) fn check() -> TaskResult {
    let python = environment("lerobot-base")?;
    run_command(pip(&python).args(["--no-deps", LEROBOT]))?;
    run_command(pip(&python).args(BASE_PACKAGES).args(TEST_PACKAGES))?;
    install_plugin(&python)?;
    let [tests, commands] = ["tests", "command_tests"].map(|name| plugin().join(name));
    mypy(&python, &["-p".as_ref(), "lerobot_robot_sevenbot".as_ref()])?;
    mypy(&python, &[&tests])?;
    mypy(&python, &[&commands])?;
    run_command(&mut pytest(&python, &tests))
}

/// Tests LeRobot's own commands with the plugin. The first run installs all of LeRobot.
pub(crate) fn commands() -> TaskResult {
    let python = environment("lerobot-whole")?;
    if !python.with_file_name("lerobot-record").exists() {
        need_disk()?;
    }
    run_command(pip(&python).arg("--no-cache-dir").args([WHOLE]).args(TEST_PACKAGES))?;
    install_plugin(&python)?;
    run_command(&mut pytest(&python, &plugin().join("tests")))?;
    emulator::need_qemu()?;
    build_image()?;
    build_host_sim()?;
    // The tests start the emulator: `cargo xtask emulate`.
    run_command(pytest(&python, &plugin().join("command_tests")).env("XTASK", env::current_exe()?))
}

fn plugin() -> PathBuf {
    root().join("python/lerobot")
}

/// An environment of its own, which is kept for the next run.
fn environment(name: &str) -> TaskResult<PathBuf> {
    venv::with_packages(&folder().join(name), || interpreter("LeRobot", (3, 12)..=(3, 14)), &[])
}

/// Fails if there is too little free disk, before anything is downloaded.
fn need_disk() -> TaskResult {
    let output = Command::new("df").args(["-Pk"]).arg(folder()).output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let kib = text.lines().nth(1).and_then(|line| line.split_whitespace().nth(3)?.parse::<u64>().ok());
    let free = kib.ok_or("df does not tell how much of the disk is free")? >> 20;
    println!("LeRobot with all its packages: {NEEDED_GIB} GiB are needed, {free} GiB are free");
    if free >= NEEDED_GIB {
        return Ok(());
    }
    Err(format!(
        "THE DISK IS TOO FULL: LeRobot needs {NEEDED_GIB} GiB below {}, and {free} GiB are free. LeRobot's commands were not tested",
        folder().display()
    )
    .into())
}

/// Installs the package and the plugin, without their dependencies.
fn install_plugin(python: &Path) -> TaskResult {
    let copy = folder().join("lerobot-plugin");
    copy_of(&plugin(), &copy)?;
    run_command(pip(python).args(["--force-reinstall", "--no-deps"]).arg(wheel()?).arg(&copy))
}

fn module(python: &Path, name: &str) -> Command {
    let mut command = Command::new(python);
    // Run it outside the folder of the sources, so that Python does not import them.
    command.args(["-m", name]).current_dir(folder());
    command
}

fn mypy(python: &Path, what: &[&Path]) -> TaskResult {
    let config = plugin().join("pyproject.toml");
    run_command(module(python, "mypy").args(["--strict", "--config-file"]).arg(config).args(what))
}

fn pytest(python: &Path, tests: &Path) -> Command {
    let mut command = module(python, "pytest");
    command.args(["--quiet", "-p", "no:cacheprovider", "--config-file"]);
    command.arg(plugin().join("pyproject.toml")).arg(tests);
    command
}
