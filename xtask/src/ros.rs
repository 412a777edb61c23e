//! The ROS packages: installed with ROS 2 from PyPI into an environment of their own, and tested in a network of their own.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::python::{copy_of, wheel};
use crate::run::{
    TESTED, TaskResult, build_host_sim, build_image, cargo, root, run_command, target_directory,
};
use crate::venv::{self, interpreter, pip};

/// The packages from PyPI, at versions that were tried.
const PACKAGES: [&str; 15] = [
    "ros-jazzy-rclpy==7.1.6",
    "ros-jazzy-rmw-fastrtps-cpp==8.4.3",
    "ros-jazzy-sensor-msgs==5.3.6",
    "ros-jazzy-diagnostic-msgs==5.3.6",
    "ros-jazzy-std-srvs==5.3.6",
    "ros-jazzy-trajectory-msgs==5.3.6",
    "ros-jazzy-test-msgs==2.0.3",
    "rosbags==0.11.9",
    "rerun-sdk==0.41.0",
    "python-fcl==0.7.0.11",
    "numpy==2.2.6",
    "PyYAML==6.0.4",
    "mypy==2.4.1",
    "pytest==9.2.0",
    "pytest-xdist==3.8.0",
];
/// Number of processes that run tests. Most tests wait for an arm.
const PROCESSES: &str = "2";
/// The commands that start the network of the tests. It has only the loopback interface, and needs no administrator.
const NETWORK: &str = "ip link set lo up && exec \"$@\"";

/// Installs and tests the packages.
pub(crate) fn check() -> TaskResult {
    let python =
        venv::with_packages(&folder().join("venv"), || interpreter("ROS 2", (3, 10)..=(3, 13)), &PACKAGES)?;
    let wheel = wheel()?;
    // The copy has another name than the package, so that Python imports the installed package.
    let package = folder().join("package");
    copy_of(&root().join("ros/sevenbot_ros"), &package)?;
    run_command(pip(&python).args(["--force-reinstall", "--no-deps"]).args([&wheel, &package]))?;
    check_types(&python)?;
    build_host_sim()?;
    cargo(&format!("build --quiet {TESTED} --bin sevenbot"))?;
    build_image()?;
    test(&python)
}

fn folder() -> PathBuf {
    target_directory().join("ros")
}

/// Checks the types of the installed package.
fn check_types(python: &Path) -> TaskResult {
    let mut command = Command::new(python);
    command.args(["-m", "mypy", "--config-file"]).arg(root().join("ros/mypy.ini"));
    run_command(command.args(["-p", "sevenbot_ros"]).current_dir(folder()))
}

/// Runs the tests in a network that has only the loopback interface.
fn test(python: &Path) -> TaskResult {
    let mut command = Command::new("unshare");
    command.args(["--net", "--map-root-user", "sh", "-c", NETWORK, "sh"]).arg(python);
    command.args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider", "-n", PROCESSES, "--config-file"]);
    command.arg(root().join("ros/pytest.ini")).arg(root().join("ros/tests"));
    command
        .env("HOST_SIM", target_directory().join("debug/host-sim"))
        .env("SEVENBOT", target_directory().join("debug/sevenbot"))
        .env("XTASK", env::current_exe()?)
        .env("ROS_LOG_DIR", folder().join("log"))
        // The programs of the tests share this folder, and leave no bytecode beside the sources.
        .env("PYTHONPYCACHEPREFIX", folder().join("bytecode"))
        .current_dir(folder());
    run_command(&mut command)
}
