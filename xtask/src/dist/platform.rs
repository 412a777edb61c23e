//! The systems that a release is for, and how programs are built for them.

use std::env::{self, consts::ARCH};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::release::Release;
use super::tools;
use crate::run::{TaskResult, root, run_command, target_directory};

/// The profile of the programs and the Python module of a release. The page and the image have their own profiles.
pub(super) const PROFILE: &str = "dist";
/// The oldest version of the C library with which Linux programs run: of the year 2012, as in `manylinux2014`.
const GLIBC: &str = "2.17";

/// A system that a release is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Platform {
    pub(super) triple: &'static str,
    /// In names of archives.
    pub(super) name: &'static str,
    /// Debian's name for the processor; `None`: the system is not Linux.
    pub(super) debian: Option<&'static str>,
    /// In names of wheels.
    pub(super) wheel: &'static str,
}

pub(super) const LINUX_X86_64: Platform = Platform {
    triple: "x86_64-unknown-linux-gnu",
    name: "linux-x86_64",
    debian: Some("amd64"),
    wheel: "manylinux2014_x86_64.manylinux_2_17_x86_64",
};
pub(super) const LINUX_AARCH64: Platform = Platform {
    triple: "aarch64-unknown-linux-gnu",
    name: "linux-aarch64",
    debian: Some("arm64"),
    wheel: "manylinux2014_aarch64.manylinux_2_17_aarch64",
};
pub(super) const WINDOWS: Platform =
    Platform { triple: "x86_64-pc-windows-gnu", name: "windows-x86_64", debian: None, wheel: "win_amd64" };

/// All systems that a release is for.
pub(super) const PLATFORMS: [Platform; 3] = [LINUX_X86_64, LINUX_AARCH64, WINDOWS];

impl Platform {
    /// The programs for this system. `host-sim` needs pseudo-terminals, so there is none for Windows.
    pub(super) fn programs(self) -> &'static [&'static str] {
        if self.debian.is_some() { &["host-sim", "sevenbot"] } else { &["sevenbot.exe"] }
    }

    /// Makes zig the compiler and the linker of a build for Linux.
    pub(super) fn use_zig(self, command: &mut Command) -> TaskResult {
        tools::use_zig(command, self.triple, GLIBC)
    }

    /// Builds the programs. Returns their folder.
    pub(super) fn build(self, release: &Release) -> TaskResult<PathBuf> {
        add_target(self.triple)?;
        let mut command = match self.debian {
            Some(_) => {
                let mut zigbuild = tools::zigbuild()?;
                zigbuild.args(["--package", "host-sim"]);
                zigbuild.args(["--target", &format!("{}.{GLIBC}", self.triple)]);
                self.use_zig(&mut zigbuild)?;
                zigbuild
            }
            None => {
                let mut cargo = Command::new("cargo");
                cargo.args(["build", "--target", self.triple]);
                cargo
            }
        };
        command.args(["--quiet", "--locked", "--profile", PROFILE, "--package", "sevenbot-cli"]);
        reproducible(&mut command, release, self.triple)?;
        run_command(command.current_dir(root()))?;
        Ok(build_directory().join(self.triple).join(PROFILE))
    }
}

/// Installs the standard library for a system.
pub(super) fn add_target(triple: &str) -> TaskResult {
    run_command(Command::new("rustup").args(["--quiet", "target", "add", triple]).current_dir(root()))
}

pub(super) fn host_platform() -> TaskResult<Platform> {
    match ARCH {
        "x86_64" => Ok(LINUX_X86_64),
        "aarch64" => Ok(LINUX_AARCH64),
        other => Err(format!("a release is made on x86_64 or aarch64, not on {other}").into()),
    }
}

/// Where a release is built: apart from all other builds, whose settings differ.
pub(super) fn build_directory() -> PathBuf {
    target_directory().join(PROFILE)
}

/// Sets the flags and variables that make the bytes of a build depend on the commit only.
pub(super) fn reproducible(command: &mut Command, release: &Release, triple: &str) -> TaskResult {
    let name = triple.to_uppercase().replace('-', "_");
    let mut all = remapped_paths()?.join(" ");
    if triple == WINDOWS.triple {
        all.push_str(" -Clink-arg=-Wl,--no-insert-timestamp");
    }
    command
        .env(format!("CARGO_TARGET_{name}_RUSTFLAGS"), all)
        .env("CARGO_TARGET_DIR", build_directory())
        .env("SOURCE_DATE_EPOCH", release.epoch.to_string())
        .env("SEVENBOT_RELEASE", release.text());
    Ok(())
}

/// Flags that keep the paths of this computer out of programs.
fn remapped_paths() -> TaskResult<Vec<String>> {
    let home = |variable: &str, folder: &str| {
        env::var_os(variable).map(PathBuf::from).or_else(|| Some(env::home_dir()?.join(folder)))
    };
    let cargo = home("CARGO_HOME", ".cargo").ok_or("this user has no home directory")?;
    let rustup = home("RUSTUP_HOME", ".rustup").ok_or("this user has no home directory")?;
    let remap = |from: &Path, to: &str| format!("--remap-path-prefix={}={to}", from.display());
    let flags = vec![remap(root(), "/sevenbot"), remap(&cargo, "/cargo"), remap(&rustup, "/rustup")];
    if flags.iter().any(|flag| flag.contains(' ')) {
        return Err("a release cannot be made in a folder with a space in its path".into());
    }
    Ok(flags)
}

/// Reads a program that was built.
pub(super) fn read_program(folder: &Path, name: &str) -> TaskResult<Vec<u8>> {
    let path = folder.join(name);
    Ok(fs::read(&path).map_err(|why| format!("{}: {why}", path.display()))?)
}
