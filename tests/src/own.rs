//! An arm of a test's own: started, switched off and on, killed, and gone with the test.
//!
//! ```text
//!   Simulator, Emulator:  port ──▶ one process
//!   Adapter:              port ──▶ host-sim --servos ──▶ link ──▶ host-sim --servos-only
//! ```

use std::env;
use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread;

use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

use crate::line::PATIENCE;
use crate::programs::{host_sim, xtask};
use crate::target::{Need, Target};

/// Where the arm's controller runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum World {
    /// In the simulator.
    Simulator,
    /// In the image for the real arm, in an emulator, with the simulator's servos.
    Emulator,
    /// In a simulator that drives servos behind a USB adapter; adapter and servos are simulated by a second process.
    Adapter,
}

/// How long the simulated adapter gathers bytes, in milliseconds: from a short latency timer to a busy host.
const USB_LATENCY: &str = "1-4";
/// How long the controller behind the adapter waits for an answer, in milliseconds: longer than a busy machine delays
/// it, and less than the delay of a servo that a test makes late.
const USB_TIMEOUT: &str = "300";

impl World {
    /// The kind that the variable `ARM` names; the simulator where it names none.
    ///
    /// # Panics
    /// With a name that is none: the tests would run against another arm than was asked for.
    #[must_use]
    pub fn chosen() -> Self {
        match env::var("ARM").as_deref() {
            Err(_) | Ok("simulator") => Self::Simulator,
            Ok("emulator") => Self::Emulator,
            Ok("adapter") => Self::Adapter,
            Ok(other) => panic!("ARM={other}: use simulator, emulator or adapter"),
        }
    }

    /// The controller, with the servos where they are its own.
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

    /// The servos, where they are a process of their own.
    fn servos(self, folder: &Path) -> Option<Command> {
        (self == Self::Adapter).then(|| {
            let mut command = Command::new(host_sim());
            command.args(["--servos-only", "--usb-latency", USB_LATENCY, "--link"]).arg(folder.join("bus"));
            command
        })
    }

    /// Is this option for the process of the servos?
    fn gives_servos(self, option: &str) -> bool {
        self == Self::Adapter && option == "--fault"
    }

    /// Why an arm there cannot meet a need; `None` if it can.
    #[must_use]
    pub const fn lacks(self, need: Need) -> Option<&'static str> {
        match (self, need) {
            (Self::Emulator, Need::Persistence | Need::ExpendableStorage) => {
                Some("the emulator's flash ignores what it is told")
            }
            (Self::Emulator, Need::Kill) => Some("the emulated arm has no settings that could survive"),
            (Self::Emulator, Need::ChosenChipId) => Some("the emulator has no unique id to choose"),
            _ => None,
        }
    }
}

/// A running arm that nobody else uses.
pub struct OwnArm {
    world: World,
    processes: Processes,
    options: Vec<(String, String)>,
    /// Holds the settings and the log; both go with it.
    folder: TempDir,
}

/// What an arm consists of. The servos are first in every order.
struct Processes {
    servos: Option<Child>,
    controller: Child,
    port: PathBuf,
}

impl OwnArm {
    /// Starts one with these options and their values.
    #[must_use]
    pub fn start(world: World, options: Vec<(String, String)>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let processes = Processes::launch(world, folder.path(), &options);
        Self { world, processes, options, folder }
    }

    /// The simulator has nothing to tidy up; the emulator has processes of its own.
    fn end(&mut self) {
        let Processes { servos, controller, .. } = &mut self.processes;
        match self.world {
            // Errors mean that it is gone already, which is what is wanted.
            World::Simulator | World::Adapter => drop(controller.kill()),
            World::Emulator => signal(controller, Signal::TERM),
        }
        let _ = controller.wait();
        if let Some(servos) = servos {
            let _ = servos.kill();
            let _ = servos.wait();
        }
    }
}

impl Processes {
    fn launch(world: World, folder: &Path, options: &[(String, String)]) -> Self {
        let options_of = |are_servos: bool| {
            let wanted = options.iter().filter(move |(name, _)| world.gives_servos(name) == are_servos);
            wanted.flat_map(|(name, value)| [name, value])
        };
        let servos = world.servos(folder).map(|mut command| {
            let (process, _) = launch(command.args(options_of(true)), folder);
            process
        });
        let (controller, port) = launch(world.controller(folder).args(options_of(false)), folder);
        Self { servos, controller, port }
    }
}

fn signal(process: &Child, signal: Signal) {
    let id = i32::try_from(process.id()).ok().and_then(Pid::from_raw).expect("a process id");
    kill_process(id, signal).expect("the arm is running");
}

/// Starts a process, and waits for the port that it names.
fn launch(command: &mut Command, folder: &Path) -> (Child, PathBuf) {
    let log = File::options().create(true).append(true).open(folder.join("log")).expect("a log file");
    let mut process =
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(log).spawn().expect("the arm starts");
    let output = process.stdout.take().expect("a pipe");
    let (sender, first_line) = mpsc::channel();
    // Reads to the end, so that the program never writes into a closed pipe.
    thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            let _ = sender.send(line);
        }
    });
    let line = first_line.recv_timeout(PATIENCE).unwrap_or_default();
    let port = line.strip_prefix("ready ").map(PathBuf::from);
    let log = || fs::read_to_string(folder.join("log")).unwrap_or_default();
    let port = port.unwrap_or_else(|| panic!("not ready but {line:?}; it says:\n{}", log()));
    (process, port)
}

impl Target for OwnArm {
    fn port(&self) -> &Path {
        &self.processes.port
    }

    fn lacks(&self, need: Need) -> Option<&'static str> {
        self.world.lacks(need)
    }

    fn power_cycle(&mut self) {
        if let Some(servos) = &self.processes.servos {
            signal(servos, Signal::HUP);
        }
        signal(&self.processes.controller, Signal::HUP);
    }

    fn restart_controller(&mut self) {
        signal(&self.processes.controller, Signal::USR2);
    }

    fn restart_after_kill(&mut self) {
        self.end();
        self.processes = Processes::launch(self.world, self.folder.path(), &self.options);
    }
}

impl Drop for OwnArm {
    fn drop(&mut self) {
        self.end();
        if thread::panicking() {
            let log = fs::read_to_string(self.folder.path().join("log")).unwrap_or_default();
            eprintln!("--- what the arm said ---\n{log}-------------------------");
        }
    }
}
