//! An arm of a test's own: started, switched off and on, killed, and gone with the test.

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
}

impl World {
    fn command(self, folder: &Path) -> Command {
        match self {
            Self::Simulator => {
                let mut command = Command::new(host_sim());
                command.arg("--eeprom").arg(folder.join("eeprom"));
                command
            }
            Self::Emulator => {
                let mut command = Command::new(xtask());
                command.args(["emulate", "--no-build"]);
                command
            }
        }
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
    process: Child,
    port: PathBuf,
    options: Vec<String>,
    /// Holds the settings and the log; both go with it.
    folder: TempDir,
}

impl OwnArm {
    /// Starts one with these options.
    #[must_use]
    pub fn start(world: World, options: Vec<String>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (process, port) = launch(world, folder.path(), &options);
        Self { world, process, port, options, folder }
    }

    fn signal(&self, signal: Signal) {
        let id = i32::try_from(self.process.id()).ok().and_then(Pid::from_raw).expect("a process id");
        kill_process(id, signal).expect("the arm is running");
    }

    /// The simulator has nothing to tidy up; the emulator has processes of its own.
    fn end(&mut self) {
        match self.world {
            // Errors mean that it is gone already, which is what is wanted.
            World::Simulator => drop(self.process.kill()),
            World::Emulator => self.signal(Signal::TERM),
        }
        let _ = self.process.wait();
    }
}

fn launch(world: World, folder: &Path, options: &[String]) -> (Child, PathBuf) {
    let log = File::options().create(true).append(true).open(folder.join("log")).expect("a log file");
    let mut process = world
        .command(folder)
        .args(options)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(log)
        .spawn()
        .expect("the arm starts");
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
        &self.port
    }

    fn lacks(&self, need: Need) -> Option<&'static str> {
        self.world.lacks(need)
    }

    fn power_cycle(&mut self) {
        self.signal(Signal::HUP);
    }

    fn restart_after_kill(&mut self) {
        self.end();
        (self.process, self.port) = launch(self.world, self.folder.path(), &self.options);
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
