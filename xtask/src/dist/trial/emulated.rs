//! `sevenbot` and the wheel for aarch64, in qemu with the libraries of Debian for that processor.

use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use super::bare_root;
use super::installed::FIRST_PROGRAM;
use crate::dist::contents::archive_name;
use crate::dist::platform::LINUX_AARCH64;
use crate::dist::release::Release;
use crate::dist::wheels;
use crate::run::{TaskResult, run_command, target_directory};

/// Emulates a program for aarch64 on the kernel of this computer.
const QEMU: &str = "qemu-aarch64-static";

/// Tries `sevenbot` and the wheel.
pub(super) fn aarch64(release: &Release) -> TaskResult {
    let packed = target_directory().join("dist-roots/debian-arm64.tar");
    let packed =
        bare_root::make(&packed, &["--variant=extract", "--architectures=arm64", "--include=python3"])?;
    let folder = TempDir::new()?;
    let root = folder.path().join("root");
    unpack(&packed, &root)?;
    let programs = folder.path().join("programs");
    unpack(&release.path(&archive_name(release, LINUX_AARCH64)), &programs)?;
    let program =
        programs.join(format!("sevenbot-{}-{}", release.version, LINUX_AARCH64.name)).join("bin/sevenbot");
    let emulated = |program: &Path| {
        let mut qemu = Command::new(QEMU);
        qemu.arg("-L").arg(&root).arg(program).current_dir(folder.path());
        qemu
    };
    let moments = folder.path().join("moments.txt");
    run_command(emulated(&program).args(["--port", "sim", "info"]))?;
    run_command(
        emulated(&program)
            .args(["--port", "sim", "pose", "120", "90", "65", "90", "90", "90", "80", "--wait"]),
    )?;
    run_command(
        emulated(&program)
            .args(["--port", "sim", "record", "--driven", "--yes", "--seconds", "1"])
            .arg(moments),
    )?;
    let module = folder.path().join("module");
    let mut unzip = Command::new("python3");
    unzip.args(["-m", "zipfile", "-e"]).arg(release.path(&wheels::wheel(release, LINUX_AARCH64)));
    run_command(unzip.arg(&module))?;
    let mut python = emulated(&root.join("usr/bin/python3"));
    python.args(["-c", FIRST_PROGRAM]).env("PYTHONPATH", module).env("PYTHONHOME", root.join("usr"));
    run_command(&mut python)
}

fn unpack(archive: &Path, folder: &Path) -> TaskResult {
    std::fs::create_dir(folder)?;
    let mut tar = Command::new("tar");
    tar.args(["--extract", "--exclude=./dev/*", "--directory"]).arg(folder).arg("--file").arg(archive);
    run_command(&mut tar)
}
