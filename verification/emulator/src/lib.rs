//! The unmodified image for the arm in an emulator, with simulated servos, and a port for any serial
//! client. `cargo xtask emulate` builds the image and runs it here.
//!
//! ```text
//!   client ══ port ══ Relay ── socket ── USART1 ┌──────────┐ USART2 ── socket ── host-sim --servo-socket
//!                                               │   qemu   │
//!                                   Log ── QMP ─┤ the image│
//!                                               └──────────┘
//! ```
//!
//! QEMU's own ports detect a new client only once a second. They drop bytes until then.

use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;
use host_sim::signals::{SignalAction, Signals};
use protocol_core::request::Request;
use protocol_core::wire::FrameBuffer;
use tempfile::TempDir;
use tty_ports::symlink::Symlink;

pub mod chip_program;
mod debugger;
pub mod emulated_arm;
mod instruction_log;
pub mod lockstep;
mod log;
pub mod logged_image;
mod machine;
mod monitor;
pub mod process;
mod relay;
pub mod trace;

use chip_program::{IMAGE, SELF_TEST, target_directory};
use log::Log;
use machine::{Machine, servo_socket};
use process::{ChildProcess, TaskResult};
use relay::Relay;

pub use machine::{QEMU, qemu};

const HOW_TO_GET_QEMU: &str =
    "`sudo apt-get install qemu-system-arm` installs it on Debian and Ubuntu, `brew install qemu` on a Mac";

/// The setup of the emulated arm.
#[derive(Args)]
pub struct EmulateArgs {
    /// Make this symbolic link to the port while the emulator runs
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Break a servo: JOINT=KIND, as in `host-sim --fault`; can be repeated
    #[arg(long, value_name = "JOINT=KIND")]
    fault: Vec<String>,
    /// Print the firmware's log on standard error (needs defmt-print: `cargo install defmt-print`)
    #[arg(long)]
    log: bool,
    /// Run the self-test image for the first power-up of a board
    #[arg(long)]
    self_test: bool,
    /// Write the bytes to the servos into this file
    #[arg(long, value_name = "PATH")]
    servo_line: Option<PathBuf>,
    /// Write the true angles of the joints into this file: see `host-sim --help`
    #[arg(long, value_name = "PATH")]
    angles: Option<PathBuf>,
    /// Use the image and the simulator of the last build
    #[arg(long)]
    pub no_build: bool,
}

/// Runs the image until a signal ends it. Prints `ready` and the path of the port when the image receives host bytes. SIGHUP
/// switches the arm off and on, SIGUSR2 resets the chip alone.
pub fn run(options: &EmulateArgs) -> TaskResult {
    need_qemu()?;
    let mut signals = Signals::catch()?;
    let folder = tempfile::tempdir()?;
    let servos = start_servos(&folder, &options.fault, options.angles.as_deref())?;
    let image = if options.self_test { &SELF_TEST } else { &IMAGE };
    let mut servo_line = servo_socket(&folder);
    if let Some(path) = &options.servo_line {
        servo_line = format!("{servo_line},logfile={}", std::path::absolute(path)?.display());
    }
    let mut machine = Machine::start(image, folder, &servo_line, &[])?;
    let mut relay = Relay::new(machine.host.try_clone()?)?;
    machine.wait_for_host_link()?;
    let mut log = options.log.then(|| Log::open(&image.path())).transpose()?;
    let port = relay.port().to_owned();
    let _link = options.link.as_deref().map(|path| Symlink::new(path, &port)).transpose()?;
    let mut out = io::stdout().lock();
    // A closed pipe is no error.
    let _ = writeln!(out, "ready {}", port.display()).and_then(|()| out.flush());
    loop {
        for action in signals.actions() {
            match action {
                SignalAction::End => return Ok(()),
                SignalAction::Unplug => {}
                SignalAction::PowerCycle => power_cycle(&servos, &mut machine)?,
                SignalAction::RestartController => machine.reset()?,
            }
        }
        if let Some(log) = &mut log {
            log.print_new(&mut machine.monitor)?;
        }
        relay.transfer()?;
        relay.sleep(&signals, log.is_some())?;
    }
}

fn has_qemu() -> bool {
    Command::new(QEMU).arg("--version").stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// Fails with instructions if the emulator is not installed.
///
/// # Errors
/// The emulator is not installed. The error tells how to install it.
pub fn need_qemu() -> TaskResult {
    if has_qemu() {
        return Ok(());
    }
    Err(format!("{QEMU} is missing: {HOW_TO_GET_QEMU}, or let `cargo xtask test` install it"))?
}

/// Starts `host-sim` with the seven servos on a socket in `folder`. `angles` is the file for the true angles of the joints.
fn start_servos(folder: &TempDir, faults: &[String], angles: Option<&Path>) -> TaskResult<ChildProcess> {
    let mut command = Command::new(target_directory().join("debug").join("host-sim"));
    command.arg("--quiet").arg("--servo-socket").arg(folder.path().join("servos"));
    faults.iter().for_each(|fault| {
        command.arg("--fault").arg(fault);
    });
    angles.iter().for_each(|path| {
        command.arg("--angles").arg(path);
    });
    let mut child = ChildProcess(command.stdout(Stdio::piped()).spawn()?);
    let mut line = String::new();
    if let Some(output) = child.0.stdout.take() {
        BufReader::new(output).read_line(&mut line)?;
    }
    if line.starts_with("ready ") { Ok(child) } else { Err("host-sim did not start: see above")? }
}

fn power_cycle(servos: &ChildProcess, machine: &mut Machine) -> TaskResult {
    let id = i32::try_from(servos.0.id()).ok().and_then(rustix::process::Pid::from_raw);
    let id = id.ok_or("host-sim has no process id")?;
    rustix::process::kill_process(id, rustix::process::Signal::HUP)?;
    machine.reset()
}

/// Encodes a request as a frame.
#[must_use]
pub fn frame(request: Request<'_>) -> Vec<u8> {
    let mut buffer = FrameBuffer::new();
    request.encode(&mut buffer);
    buffer.to_vec()
}
