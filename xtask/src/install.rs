//! Installs the tools that the steps of `cargo xtask test` need, unless they are installed.

use std::process::{Command, Stdio};

use crate::run::{BROWSER, CHIP, TaskResult, run};
use emulator::QEMU;

/// A program that Rust does not include.
struct Tool {
    program: &'static str,
    /// Arguments with which it succeeds.
    arguments: &'static [&'static str],
    /// Its package in Debian and Ubuntu.
    package: &'static str,
    /// Its purpose.
    purpose: &'static str,
}

/// All programs know this.
const VERSION: &[&str] = &["--version"];

const TOOLS: [Tool; 8] = [
    Tool { program: QEMU, arguments: VERSION, package: QEMU, purpose: "runs the image for the arm" },
    Tool { program: "c++", arguments: VERSION, package: "g++", purpose: "builds the fuzzer" },
    Tool {
        program: "chromium",
        arguments: VERSION,
        package: "chromium",
        purpose: "shows the page in its tests",
    },
    Tool {
        program: "firefox-esr",
        arguments: VERSION,
        package: "firefox-esr",
        purpose: "shows the page in another browser",
    },
    Tool { program: "Xvfb", arguments: &["-help"], package: "xvfb", purpose: "is the screen of Firefox" },
    Tool { program: "python3", arguments: VERSION, package: "python3", purpose: "runs the Python package" },
    Tool {
        program: "python3",
        arguments: &["-c", "import ensurepip, venv"],
        package: "python3-venv",
        purpose: "makes environments for the Python package",
    },
    Tool {
        program: "ip",
        arguments: &["-Version"],
        package: "iproute2",
        purpose: "opens the network of the tests with ROS",
    },
];

/// Installs the missing tools.
pub(crate) fn all() -> TaskResult {
    run("rustup", "component add clippy rustfmt", &[])?;
    run("rustup", &format!("target add {CHIP} {BROWSER}"), &[])?;
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
        program.args(self.arguments).stdout(Stdio::null()).stderr(Stdio::null());
        program.status().is_ok_and(|status| status.success())
    }
}
