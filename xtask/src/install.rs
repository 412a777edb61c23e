//! Installs the tools that `cargo xtask test` and the trial of a release need, unless they are installed.

use std::process::{Command, Stdio};

use crate::run::{BROWSER, CHIP, TaskResult, run};
use emulator::QEMU;

/// A program that Rust does not include.
struct Tool {
    program: &'static str,
    /// Arguments with which it succeeds.
    arguments: &'static [&'static str],
    /// Its packages in Debian and Ubuntu.
    package: &'static str,
    /// Its purpose, as the end of a sentence: "runs the Python package".
    purpose: &'static str,
}

/// A tool that knows `--version`.
const fn tool(program: &'static str, package: &'static str, purpose: &'static str) -> Tool {
    Tool { program, arguments: &["--version"], package, purpose }
}

const TOOLS: [Tool; 10] = [
    tool(QEMU, QEMU, "runs the image for the arm"),
    tool("curl", "curl ca-certificates", "fetches the editor of the page's programs"),
    tool("c++", "g++", "builds the fuzzer"),
    tool("chromium", "chromium", "shows the page in its tests"),
    tool("firefox-esr", "firefox-esr", "shows the page in another browser"),
    Tool { arguments: &["-help"], ..tool("Xvfb", "xvfb", "is the screen of Firefox") },
    tool("python3", "python3", "runs the Python package"),
    Tool {
        arguments: &["-c", "import ensurepip, venv"],
        ..tool("python3", "python3-venv", "makes environments for the Python package")
    },
    Tool { arguments: &["-Version"], ..tool("ip", "iproute2", "opens the network of the tests with ROS") },
    tool("x86_64-w64-mingw32-gcc", "gcc-mingw-w64-x86-64", "links the programs for Windows"),
];

/// The tools that make and try a release.
const RELEASE_TOOLS: [Tool; 6] = [
    tool("dpkg-deb", "dpkg", "makes the Debian package"),
    tool("mmdebstrap", "mmdebstrap", "makes the bare system on which a release is tried"),
    tool("wine", "wine", "runs the program for Windows"),
    tool("qemu-aarch64-static", "qemu-user-static", "runs the programs for aarch64"),
    tool("lintian", "lintian", "checks the Debian package"),
    tool("dfu-suffix", "dfu-util", "checks the image for USB"),
];

/// Installs the missing tools that each run of the tests needs.
pub(crate) fn all() -> TaskResult {
    run("rustup", "component add clippy rustfmt", &[])?;
    run("rustup", &format!("target add {CHIP} {BROWSER}"), &[])?;
    install_missing(&TOOLS)
}

/// Installs the missing tools that make and try a release.
pub(crate) fn for_release() -> TaskResult {
    install_missing(&RELEASE_TOOLS)
}

fn install_missing(tools: &[Tool]) -> TaskResult {
    let missing: Vec<_> = tools.iter().filter(|tool| !tool.works()).collect();
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
