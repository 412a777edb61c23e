//! The tools from PyPI and crates.io that make a release, each at the version that was tried.

use std::env;
use std::ffi::OsString;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use crate::run::{TaskResult, run_command, target_directory};
use crate::venv;

/// From PyPI: zig, which compiles for other systems, the program that calls it, and the programs that make wheels.
const PYTHON_PACKAGES: [&str; 5] =
    ["cargo-zigbuild==0.24.1", "maturin==1.16.0", "setuptools==82.0.1", "wheel==0.48.0", "ziglang==0.15.2"];
/// From crates.io: the program that lists the parts of a program.
const CYCLONEDX: (&str, &str) = ("cargo-cyclonedx", "0.5.9");

/// Where the tools are. They are kept for the next release.
fn folder() -> PathBuf {
    target_directory().join("dist-tools")
}

/// The Python of an environment with the packages.
pub(super) fn python() -> TaskResult<PathBuf> {
    venv::with_packages(&folder().join("venv"), || Ok("python3".into()), &PYTHON_PACKAGES)
}

/// `PATH`, with the programs of the environment first: there zig is found.
pub(super) fn search_path() -> TaskResult<OsString> {
    let mut folders = vec![python()?.with_file_name("")];
    folders.extend(env::split_paths(&env::var_os("PATH").unwrap_or_default()));
    Ok(env::join_paths(folders)?)
}

/// `cargo zigbuild`: zig compiles C code, and links.
pub(super) fn zigbuild() -> TaskResult<Command> {
    let mut command = Command::new(python()?.with_file_name("cargo-zigbuild"));
    command.arg("zigbuild").env("PATH", search_path()?);
    Ok(command)
}

/// Makes zig the compiler and the linker of a Linux target for programs with `glibc`. `cargo-zigbuild` and maturin would each call
/// zig by another path, and cargo would build all crates again for each path.
pub(super) fn use_zig(command: &mut Command, triple: &str, glibc: &str) -> TaskResult {
    let (target, variable) = (triple.replace("-unknown", ""), triple.replace('-', "_"));
    let compiler = format!("zig cc -- -g -fno-sanitize=all -target {target}.{glibc}");
    let compiler = zig_script(&format!("zigcc-{triple}"), &compiler)?;
    command.env(format!("CARGO_TARGET_{}_LINKER", variable.to_uppercase()), &compiler);
    command.env(format!("CC_{variable}"), compiler);
    command.env(format!("AR_{variable}"), zig_script("zigar", "zig ar")?);
    Ok(())
}

/// A script that calls `cargo-zigbuild` once, with these words and then the arguments of the script.
fn zig_script(name: &str, words: &str) -> TaskResult<PathBuf> {
    let (script, zigbuild) = (folder().join(name), python()?.with_file_name("cargo-zigbuild"));
    fs::write(&script, format!("#!/bin/sh\nexec {} {words} \"$@\"\n", zigbuild.display()))?;
    fs::set_permissions(&script, Permissions::from_mode(0o755))?;
    Ok(script)
}

/// `cargo-cyclonedx`, built without optimisation, which takes less time.
pub(super) fn cyclonedx() -> TaskResult<PathBuf> {
    let (name, version) = CYCLONEDX;
    let program = folder().join("bin").join(name);
    let is_installed = || {
        let output = Command::new(&program).args(["cyclonedx", "--version"]).stderr(Stdio::null()).output();
        output.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).trim().ends_with(version))
    };
    if !is_installed() {
        let mut cargo = Command::new("cargo");
        cargo.args(["install", "--quiet", "--locked", "--debug", name, "--version", version, "--root"]);
        run_command(cargo.arg(folder()).env("CARGO_TARGET_DIR", folder().join("target")))?;
    }
    Ok(program)
}
