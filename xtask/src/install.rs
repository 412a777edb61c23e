//! Installs the tools that the steps of `cargo xtask test` need, unless they are installed.

use std::process::{Command, Stdio};

use crate::emulate::QEMU;
use crate::run::{CHIP, TaskResult, run};

/// A program that Rust does not include.
struct Tool {
    program: &'static str,
    /// Its package in Debian and Ubuntu.
    package: &'static str,
    /// Its purpose.
    purpose: &'static str,
}

const TOOLS: [Tool; 3] = [
    Tool { program: QEMU, package: QEMU, purpose: "runs the image for the arm" },
    Tool { program: "c++", package: "g++", purpose: "builds the fuzzer" },
    Tool { program: "python3", package: "python3", purpose: "checks the register table for Python" },
];

/// Installs the missing tools.
pub(crate) fn all() -> TaskResult {
    run("rustup", "component add clippy rustfmt", &[])?;
    run("rustup", &format!("target add {CHIP}"), &[])?;
    let missing: Vec<_> = TOOLS.iter().filter(|tool| !tool.works()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    for tool in &missing {
        println!("{} is missing, which {}: installing it", tool.program, tool.purpose);
    }
    let packages: Vec<_> = missing.iter().map(|tool| tool.package).collect();
    let packages = packages.join(" ");
    let installed = run("apt-get", "update", &[])
        .and_then(|()| run("apt-get", &format!("install -y --no-install-recommends {packages}"), &[]));
    installed
        .map_err(|why| format!("{why}; `sudo apt-get install {packages}` installs the missing tools").into())
}

impl Tool {
    fn works(&self) -> bool {
        let mut program = Command::new(self.program);
        program.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        program.status().is_ok_and(|status| status.success())
    }
}
