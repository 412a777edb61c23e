//! The arm's model in MuJoCo: its forward kinematics must agree with `kinematics`.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;

use kinematics::limits::check_arm;
use kinematics::{Vector, forward};

use crate::run::{TaskResult, run_command, target_directory};
use crate::venv;

/// The version that is installed from PyPI.
const PACKAGE: &str = "mujoco==3.3.7";
/// Random legal poses.
const POSES: usize = 5_000;
const SCRIPT: &str = include_str!("mujoco.py");

/// Installs MuJoCo into an environment of its own, and compares many poses. Fails above 0.01 mm, or if the actuators of the model
/// do not drive the arm to a pose.
pub(crate) fn check() -> TaskResult {
    let folder = target_directory().join("mujoco");
    let python = venv::with_packages(&folder, || Ok("python3".into()), &[PACKAGE])?;
    let [script, model, poses] = ["compare.py", "7bot.xml", "poses.txt"].map(|name| folder.join(name));
    fs::write(&script, SCRIPT)?;
    fs::write(&model, arm_model::mjcf()?)?;
    write_poses(&poses)?;
    run_command(Command::new(&python).args([&script, &model, &poses]))
}

fn write_poses(path: &Path) -> TaskResult {
    let mut random = fastrand::Rng::with_seed(2_026);
    let mut lines = String::new();
    let mut count = 0;
    while count < POSES {
        let degrees = [(); 6].map(|()| random.f64() * 180.0);
        if check_arm(degrees).is_ok() {
            writeln!(lines, "{}", line(degrees))?;
            count += 1;
        }
    }
    Ok(fs::write(path, lines)?)
}

/// The angles of the model's joints, the tip and the edge of the disc.
fn line(degrees: [f64; 6]) -> String {
    let hand = forward(degrees).hand;
    let points = [hand.tip, hand.disc_edge].into_iter().flat_map(rep_103);
    let numbers = arm_model::joint_angles(degrees).into_iter().chain(points);
    numbers.map(|number| format!("{number:e}")).collect::<Vec<_>>().join(" ")
}

/// Converts from millimetres with x to the right and y forward to metres with x forward and y to the left.
fn rep_103(point: Vector<f64>) -> [f64; 3] {
    [point.y, -point.x, point.z].map(|number| number / 1000.0)
}
