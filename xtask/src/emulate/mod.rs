//! `cargo xtask emulate`: the image for the arm, unmodified, in an emulator, with simulated servos on its bus
//! and a port for any serial client.
//!
//! ```text
//!   client ══ port ══ Relay ── socket ── USART1 ┌──────────┐ USART2 ── socket ── host-sim --servo-socket
//!                                               │   qemu   │
//!                                   Log ── QMP ─┤ the image│
//!                                               └──────────┘
//! ```
//!
//! QEMU can make a port by itself, but looks for clients only once a second, and forgets what comes before.

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use clap::Args;
use host_sim::signals::{SignalAction, Signals};
use host_sim::symlink::Symlink;
use tempfile::TempDir;

use crate::run::{self, Linked, Outcome, Running, cargo, root};

mod log;
pub(crate) mod monitor;
mod relay;

use log::Log;
use monitor::Monitor;
use relay::Relay;

/// The emulator's program, in a package of the same name.
pub(crate) const QEMU: &str = "qemu-system-arm";

/// For those who do not have it.
const HOW_TO_GET_QEMU: &str =
    "`sudo apt-get install qemu-system-arm` brings it on Debian and Ubuntu, `brew install qemu` on a Mac";
/// USART1's first control register (RM0090, section 30.6). What comes before it is set up is lost.
pub(crate) const HOST_LINK_CONTROL: u32 = 0x4001_100C;
/// Its bits UE and RE.
pub(crate) const RECEIVER_ON: u32 = 1 << 13 | 1 << 2;

/// How the emulated arm is set up.
#[derive(Args)]
pub(crate) struct Options {
    /// Make this symbolic link to the port, for as long as the emulator runs
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Break a servo: JOINT=KIND, as in `host-sim --fault`; can be repeated
    #[arg(long, value_name = "JOINT=KIND")]
    fault: Vec<String>,
    /// Print the firmware's log on standard error (needs defmt-print: `cargo install defmt-print`)
    #[arg(long)]
    log: bool,
    /// Run the image for the first power-up of a board instead of the one for the arm
    #[arg(long)]
    self_test: bool,
    /// Write what the image sends to the servos into this file
    #[arg(long, value_name = "PATH")]
    servo_line: Option<PathBuf>,
    /// Take the image and the simulator as they were built last
    #[arg(long)]
    no_build: bool,
}

/// Runs the image until a signal ends it. SIGHUP switches the arm off and on, SIGUSR2 resets the chip alone.
pub(crate) fn run(options: &Options) -> Outcome {
    need_qemu()?;
    if !options.no_build {
        run::build_image()?;
        cargo("build --quiet --package host-sim")?;
    }
    let mut signals = Signals::catch()?;
    let folder = tempfile::tempdir()?;
    let servos = start_servos(&folder, &options.fault)?;
    let host = UnixListener::bind(folder.path().join("host"))?;
    let commands = UnixListener::bind(folder.path().join("monitor"))?;
    let image = if options.self_test { &run::SELF_TEST } else { &run::IMAGE };
    let mut servo_line = servo_socket(&folder);
    if let Some(path) = &options.servo_line {
        servo_line = format!("{servo_line},logfile={}", std::path::absolute(path)?.display());
    }
    let _machine = start_machine(image, &folder, &servo_line, &[])?;
    let mut relay = Relay::new(monitor::accept(&host)?)?;
    let mut monitor = Monitor::new(monitor::accept(&commands)?, folder.path())?;
    monitor.wait_for_bits(HOST_LINK_CONTROL, RECEIVER_ON)?;
    let mut log = options.log.then(|| Log::open(&image.path())).transpose()?;
    let port = relay.port().to_owned();
    let _link = options.link.as_deref().map(|path| Symlink::new(path, &port)).transpose()?;
    let mut out = io::stdout().lock();
    // Nobody has to read it.
    let _ = writeln!(out, "ready {}", port.display()).and_then(|()| out.flush());
    loop {
        for action in signals.actions() {
            match action {
                SignalAction::End => return Ok(()),
                SignalAction::Unplug => {}
                SignalAction::PowerCycle => power_cycle(&servos, &mut monitor)?,
                SignalAction::RestartController => monitor.execute("system_reset", "")?,
            }
        }
        if let Some(log) = &mut log {
            log.follow(&mut monitor)?;
        }
        relay.turn()?;
        relay.sleep(&signals, log.is_some())?;
    }
}

/// Is the emulator there?
fn has_qemu() -> bool {
    Command::new(QEMU).arg("--version").stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}

pub(crate) fn need_qemu() -> Outcome {
    if has_qemu() {
        return Ok(());
    }
    Err(format!("{QEMU} is missing: {HOW_TO_GET_QEMU}, or let `cargo xtask test` install it"))?
}

/// The seven servos, listening on a socket.
pub(crate) fn start_servos(folder: &TempDir, faults: &[String]) -> Outcome<Running> {
    let mut command = Command::new(run::target_directory().join("debug").join("host-sim"));
    command.arg("--quiet").arg("--servo-socket").arg(folder.path().join("servos"));
    faults.iter().for_each(|fault| {
        command.arg("--fault").arg(fault);
    });
    let mut child = Running(command.stdout(Stdio::piped()).spawn()?);
    let mut line = String::new();
    if let Some(output) = child.0.stdout.take() {
        BufReader::new(output).read_line(&mut line)?;
    }
    if line.starts_with("ready ") { Ok(child) } else { Err("host-sim did not start; see above why")? }
}

/// Where the servos listen, in the emulator's words.
pub(crate) fn servo_socket(folder: &TempDir) -> String {
    format!("socket,path={}", folder.path().join("servos").display())
}

/// The emulated chip, with an image in it. It connects to the sockets in `folder` before it starts. `servos` is what is on its servo bus,
/// `options` are more words for the emulator.
pub(crate) fn start_machine(
    image: &Linked,
    folder: &TempDir,
    servos: &str,
    options: &[&str],
) -> Outcome<Running> {
    let path = |name: &str| folder.path().join(name).display().to_string();
    let child = Command::new(QEMU)
        .current_dir(root())
        .args(["-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-nodefaults"])
        .args(["-chardev", &format!("socket,id=host,path={}", path("host"))])
        .args(["-serial", "chardev:host"])
        .args(["-chardev", &format!("{servos},id=servos")])
        .args(["-serial", "chardev:servos"])
        .args(["-qmp", &format!("unix:{}", path("monitor"))])
        .arg("-kernel")
        .arg(image.path())
        .args(options)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()?;
    Ok(Running(child))
}

fn power_cycle(servos: &Running, monitor: &mut Monitor) -> Outcome {
    let id = i32::try_from(servos.0.id()).ok().and_then(rustix::process::Pid::from_raw);
    let id = id.ok_or("host-sim has no process id")?;
    rustix::process::kill_process(id, rustix::process::Signal::HUP)?;
    monitor.execute("system_reset", "")
}
