//! An arm that a test starts for itself. It ends with the test.
//!
//! ```text
//!   Simulator:  port ──▶ host-sim
//!   Emulator:   port ──▶ xtask emulate, which starts the servos and the emulator
//!   Adapter:    port ──▶ host-sim --servos ──▶ link ──▶ host-sim --servos-only
//! ```

use std::env;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;

use tempfile::TempDir;

use crate::arm_control::{ArmControl, Need};
use crate::process::{self, RunningProgram, Signal, send_signal};
use crate::programs::{host_sim, xtask};

/// The kind of an arm: where its controller runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmKind {
    /// The simulator: controller and servos in one process.
    Simulator,
    /// The firmware image in an emulator, with simulated servos.
    Emulator,
    /// The simulator without servos. A second process simulates a USB adapter with servos.
    Adapter,
}

/// The latency of the simulated adapter in milliseconds: from a short latency timer to a busy host.
const USB_LATENCY: &str = "1-4";
/// The servo timeout of the controller behind the adapter, in milliseconds. It exceeds the delays of a busy machine, but
/// not the delay of a servo that a test makes late.
const USB_TIMEOUT: &str = "300";

impl ArmKind {
    /// The kind in the variable `ARM`; by default the simulator.
    ///
    /// # Panics
    /// The variable names no kind.
    #[must_use]
    pub fn chosen() -> Self {
        match env::var("ARM").as_deref() {
            Err(_) | Ok("simulator") => Self::Simulator,
            Ok("emulator") => Self::Emulator,
            Ok("adapter") => Self::Adapter,
            Ok(other) => panic!("ARM={other}: use simulator, emulator or adapter"),
        }
    }

    /// The process of the controller, and of the servos unless they have their own.
    fn controller(self, folder: &Path) -> Command {
        if self == Self::Emulator {
            let mut command = Command::new(xtask());
            command.args(["emulate", "--no-build"]);
            return command;
        }
        let mut command = Command::new(host_sim());
        command.arg("--eeprom").arg(folder.join("eeprom"));
        if self == Self::Adapter {
            command.arg("--servos").arg(folder.join("bus")).args(["--usb-timeout", USB_TIMEOUT]);
        }
        command
    }

    /// The process of the servos, if they have their own.
    fn servos(self, folder: &Path) -> Option<Command> {
        (self == Self::Adapter).then(|| {
            let mut command = Command::new(host_sim());
            command.args(["--servos-only", "--usb-latency", USB_LATENCY, "--link"]).arg(folder.join("bus"));
            command
        })
    }

    /// True if an option is for the process of the servos.
    fn is_for_servos(self, option: &str) -> bool {
        self == Self::Adapter && option == "--fault"
    }

    /// Why an arm of this kind lacks a capability; `None` if it has it.
    #[must_use]
    pub const fn lacks(self, need: Need) -> Option<&'static str> {
        match (self, need) {
            (Self::Emulator, Need::Persistence | Need::ExpendableStorage) => {
                Some("the flash of the emulator does not change")
            }
            (Self::Emulator, Need::SeesClosing) => Some("a chip does not notice who has its port open"),
            (Self::Emulator, Need::Kill) => Some("the emulated arm keeps no settings"),
            (Self::Emulator, Need::ChosenChipId) => Some("the chip id of the emulator cannot be chosen"),
            _ => None,
        }
    }
}

/// A running arm of one test.
pub struct StartedArm {
    kind: ArmKind,
    processes: Processes,
    options: Vec<(String, String)>,
    /// Holds the settings and the log.
    folder: TempDir,
}

struct Processes {
    controller: RunningProgram,
    servos: Option<RunningProgram>,
    port: PathBuf,
}

impl StartedArm {
    /// Starts an arm with these options and their values.
    #[must_use]
    pub fn start(kind: ArmKind, options: Vec<(String, String)>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let processes = Processes::launch(kind, folder.path(), &options);
        Self { kind, processes, options, folder }
    }

    fn end(&mut self) {
        self.processes.controller.kill();
        self.processes.servos.iter_mut().for_each(RunningProgram::kill);
    }
}

impl Processes {
    fn launch(kind: ArmKind, folder: &Path, options: &[(String, String)]) -> Self {
        let options_of = |for_servos: bool| {
            let selected = options.iter().filter(move |(name, _)| kind.is_for_servos(name) == for_servos);
            selected.flat_map(|(name, value)| [name, value])
        };
        let servos = kind.servos(folder).map(|mut command| launch(command.args(options_of(true)), folder).0);
        let (controller, port) = launch(kind.controller(folder).args(options_of(false)), folder);
        Self { controller, servos, port }
    }
}

/// Starts a process with one port, and a log in `folder`.
fn launch(command: &mut Command, folder: &Path) -> (RunningProgram, PathBuf) {
    let path = folder.join("log");
    let log = File::options().create(true).append(true).open(&path).expect("a log file");
    match process::start(command.stderr(log), 1) {
        Ok((process, mut ports)) => (process, ports.swap_remove(0)),
        Err(line) => panic!("not ready, but {line:?}:\n{}", fs::read_to_string(path).unwrap_or_default()),
    }
}

impl ArmControl for StartedArm {
    fn port(&self) -> &Path {
        &self.processes.port
    }

    fn lacks(&self, need: Need) -> Option<&'static str> {
        self.kind.lacks(need)
    }

    fn power_cycle(&mut self) {
        if let Some(servos) = &self.processes.servos {
            send_signal(servos, Signal::HUP);
        }
        send_signal(&self.processes.controller, Signal::HUP);
    }

    fn restart_controller(&mut self) {
        send_signal(&self.processes.controller, Signal::USR2);
    }

    fn restart_after_kill(&mut self) {
        self.end();
        self.processes = Processes::launch(self.kind, self.folder.path(), &self.options);
    }
}

impl Drop for StartedArm {
    fn drop(&mut self) {
        self.end();
        if thread::panicking() {
            let log = fs::read_to_string(self.folder.path().join("log")).unwrap_or_default();
            eprintln!("--- log of the arm ---\n{log}----------------------");
        }
    }
}
