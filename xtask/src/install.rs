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

const TOOLS: [Tool; 10] = [
    Tool { program: QEMU, arguments: VERSION, package: QEMU, purpose: "runs the image for the arm" },
    Tool {
        program: "curl",
        arguments: VERSION,
        package: "curl ca-certificates",
        purpose: "fetches the editor of the page's programs",
    },
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
    Tool {
        program: "x86_64-w64-mingw32-gcc",
        arguments: VERSION,
        package: "gcc-mingw-w64-x86-64",
        purpose: "links the programs for Windows",
    },
];

/// What makes and tries a release.
const RELEASE_TOOLS: [Tool; 6] = [
    Tool { program: "dpkg-deb", arguments: VERSION, package: "dpkg", purpose: "makes the Debian package" },
    Tool {
        program: "mmdebstrap",
        arguments: VERSION,
        package: "mmdebstrap",
        purpose: "makes the bare system on which a release is tried",
    },
    Tool { program: "wine", arguments: VERSION, package: "wine", purpose: "runs the program for Windows" },
    Tool {
        program: "qemu-aarch64-static",
        arguments: VERSION,
        package: "qemu-user-static",
        purpose: "runs the programs for aarch64",
    },
    Tool { program: "lintian", arguments: VERSION, package: "lintian", purpose: "checks the Debian package" },
    Tool {
        program: "dfu-suffix",
        arguments: VERSION,
        package: "dfu-util",
        purpose: "checks the image for USB",
    },
];

/// Installs the missing tools that each run of the tests needs.
pub(crate) fn all() -> TaskResult {
    run("rustup", "component add clippy rustfmt", &[])?;
    run("rustup", &format!("target add {CHIP} {BROWSER}"), &[])?;
    install_missing(&TOOLS)
}

/// Installs the missing tools that try a whole release.
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
