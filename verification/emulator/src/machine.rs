//! An image in the emulator, and the ends of its lines in this process.
//!
//! ```text
//!   host ═════ socket ═══ USART1 ┌──────────┐ USART2 ═══ socket ═══ servos
//!   monitor ══ socket ══════════ │   qemu   │
//!   debugger ═ socket ══════════ │ the image│
//!                                └──────────┘
//! ```

use std::os::unix::net::{UnixListener, UnixStream};
use std::process::{Command, Stdio};

use tempfile::TempDir;

use crate::chip_program::{ChipProgram, IMAGE, root};
use crate::debugger::Debugger;
use crate::monitor::{self, Monitor};
use crate::process::{ChildProcess, TaskResult};

/// The name of the emulator's program, and of its package on Debian and Ubuntu.
pub const QEMU: &str = "qemu-system-arm";
/// USART1's first control register (RM0090, section 30.6). Bytes that arrive before the setup of USART1 are lost.
const HOST_LINK_CONTROL: u32 = 0x4001_100C;
/// The bits UE and RE of this register.
const RECEIVER_ON: u32 = 1 << 13 | 1 << 2;

/// A running emulator. Its folder contains the sockets.
pub(crate) struct Machine {
    pub(crate) monitor: Monitor,
    pub(crate) host: UnixStream,
    // Declared before `folder`, so dropped before it: the emulator ends before its sockets are removed.
    _child: ChildProcess,
    folder: TempDir,
}

impl Machine {
    /// Starts an image. `servos` is the character device of the servo bus, and `options` are further options of the emulator.
    pub(crate) fn start(
        image: &ChipProgram,
        folder: TempDir,
        servos: &str,
        options: &[&str],
    ) -> TaskResult<Self> {
        let path = |name: &str| folder.path().join(name).display().to_string();
        let (host, commands) = (listen(&folder, "host")?, listen(&folder, "monitor")?);
        let child = qemu(image)
            .current_dir(root())
            .args(["-chardev", &format!("socket,id=host,path={}", path("host"))])
            .args(["-serial", "chardev:host"])
            .args(["-chardev", &format!("{servos},id=servos")])
            .args(["-serial", "chardev:servos"])
            .args(["-qmp", &format!("unix:{}", path("monitor"))])
            .args(["-gdb", &format!("unix:{},server=on,wait=off", path("debugger"))])
            .args(options)
            .stdout(Stdio::null())
            .spawn()?;
        let child = ChildProcess(child);
        let host = monitor::accept(&host)?;
        let monitor = Monitor::new(monitor::accept(&commands)?, folder.path())?;
        Ok(Self { monitor, host, _child: child, folder })
    }

    /// Starts the image for the arm. Also returns this process's end of the servo bus, for servos in this process.
    pub(crate) fn start_with_bus(folder: TempDir, options: &[&str]) -> TaskResult<(Self, UnixStream)> {
        let bus = listen(&folder, "servos")?;
        let servos = servo_socket(&folder);
        let machine = Self::start(&IMAGE, folder, &servos, options)?;
        let bus = monitor::accept(&bus)?;
        bus.set_nonblocking(true)?;
        Ok((machine, bus))
    }

    /// Waits until the image receives bytes of the host.
    pub(crate) fn wait_for_host_link(&mut self) -> TaskResult {
        self.monitor.wait_for_bits(HOST_LINK_CONTROL, RECEIVER_ON)
    }

    pub(crate) fn reset(&mut self) -> TaskResult {
        self.monitor.execute("system_reset", "")
    }

    /// Connects a debugger. The connection stops the chip.
    pub(crate) fn debugger(&self) -> TaskResult<Debugger> {
        Debugger::connect(&self.folder.path().join("debugger"))
    }
}

/// The command that starts the emulator with an image, without serial lines.
#[must_use]
pub fn qemu(image: &ChipProgram) -> Command {
    let mut command = Command::new(QEMU);
    command
        .args(["-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-nodefaults"])
        .arg("-kernel")
        .arg(image.path())
        .stdin(Stdio::null());
    command
}

/// The socket of the servos, as a character device of the emulator.
pub(crate) fn servo_socket(folder: &TempDir) -> String {
    format!("socket,path={}", folder.path().join("servos").display())
}

fn listen(folder: &TempDir, name: &str) -> TaskResult<UnixListener> {
    Ok(UnixListener::bind(folder.path().join(name))?)
}
