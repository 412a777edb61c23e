//! The Python package: built as a wheel, installed into a fresh environment, and tested there.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::run::{TaskResult, build_image, empty_folder, root, run_command, target_directory};
use crate::venv::{self, Version, pip};

/// The packages from PyPI, at versions that were tried. gymnasium, mujoco and numpy are optional for users, but have tests;
/// mcap and rosbags read the files that the package writes.
const PACKAGES: [&str; 10] = [
    "maturin==1.16.0",
    "gymnasium==1.4.0",
    "mcap==1.6.0",
    "mujoco==3.3.7; python_version < '3.14'",
    "mypy==2.4.1",
    "basedpyright==1.40.2",
    "pytest==9.2.0",
    "rosbags==0.11.9",
    "numpy==2.4.6; python_version >= '3.11'",
    "numpy==2.2.6; python_version < '3.11'",
];
/// The package for the example with several processes.
const RAY: &str = "ray==2.51.1";
/// The oldest version that the package supports.
pub(crate) const OLDEST: Version = (3, 10);

/// Builds the wheel, and tests it with each version of Python on PATH from [`OLDEST`] on.
pub(crate) fn check() -> TaskResult {
    let wheel = wheel()?;
    // The tests of block programs run on the image in the emulator.
    emulator::need_qemu()?;
    build_image()?;
    for (version, program) in interpreters() {
        println!("Python {}.{}", version.0, version.1);
        test(&environment(version, program)?, &wheel)?;
    }
    Ok(())
}

/// Tests the example with Ray, in which two workers do the work of one process. Uses the first interpreter on PATH.
pub(crate) fn ray() -> TaskResult {
    let (version, program) = first_interpreter()?;
    let python = environment(version, program)?;
    let wheel = build_wheel(&python)?;
    run_command(pip(&python).arg(RAY))?;
    run_command(pip(&python).args(["--force-reinstall", "--no-deps"]).arg(wheel))?;
    run_command(&mut pytest(&python, "python/tests/test_ray.py"))
}

/// Builds the wheel with the first interpreter on PATH.
pub(crate) fn wheel() -> TaskResult<PathBuf> {
    let (version, program) = first_interpreter()?;
    build_wheel(&environment(version, program)?)
}

fn first_interpreter() -> TaskResult<(Version, PathBuf)> {
    interpreters().next().ok_or_else(|| "no Python of at least 3.10 on PATH".into())
}

fn interpreters() -> impl Iterator<Item = (Version, PathBuf)> {
    venv::on_path().into_iter().filter(|(version, _)| *version >= OLDEST)
}

/// Where the environments and the wheel are.
pub(crate) fn folder() -> PathBuf {
    target_directory().join("python")
}

/// The Python of the environment for a version.
fn environment((major, minor): Version, program: PathBuf) -> TaskResult<PathBuf> {
    venv::with_packages(&folder().join(format!("{major}.{minor}")), || Ok(program), &PACKAGES)
}

/// Builds the wheel with the profile of the other tests, which compiles quickly.
fn build_wheel(python: &Path) -> TaskResult<PathBuf> {
    let wheels = folder().join("wheels");
    empty_folder(&wheels)?;
    let mut maturin = Command::new(python);
    maturin.args(["-m", "maturin", "build", "--quiet", "--profile", "dev", "--manifest-path"]);
    run_command(maturin.arg(root().join("python/Cargo.toml")).arg("--out").arg(&wheels))?;
    let wheel = fs::read_dir(&wheels)?.next().ok_or("maturin built no wheel")??;
    Ok(wheel.path())
}

/// Checks types and behaviour of the installed package. Runs outside the folder of the sources, so that Python does not
/// import the sources.
fn test(python: &Path, wheel: &Path) -> TaskResult {
    run_command(pip(python).args(["--force-reinstall", "--no-deps"]).arg(wheel))?;
    let module = |words: &[&str]| {
        let mut command = Command::new(python);
        command.arg("-m").args(words).current_dir(folder());
        command
    };
    let [config, tests] = ["python/pyproject.toml", "python/tests"].map(|path| root().join(path));
    run_command(module(&["mypy", "--strict", "--config-file"]).arg(&config).args(["-p", "sevenbot"]))?;
    run_command(module(&["mypy", "--strict", "--config-file"]).arg(&config).arg(&tests))?;
    run_command(&mut module(&["mypy.stubtest", "sevenbot"]))?;
    // The test with Ray needs another package: see `ray`.
    run_command(pytest(python, "python/tests").arg("--ignore").arg(root().join("python/tests/test_ray.py")))
}

/// pytest, with the programs that the step "programs and tests" has built.
fn pytest(python: &Path, tests: &str) -> Command {
    let mut command = Command::new(python);
    command.args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider", "--config-file"]);
    command.arg(root().join("python/pyproject.toml")).arg(root().join(tests)).current_dir(folder());
    command.env("SEVENBOT_PROGRAMS", target_directory().join("debug"));
    command
}

/// Copies a package, because setuptools would leave files beside the sources.
pub(crate) fn copy_of(package: &Path, copy: &Path) -> TaskResult {
    empty_folder(copy)?;
    run_command(Command::new("cp").arg("-r").arg(package.join(".")).arg(copy))
}
