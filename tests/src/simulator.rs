//! A simulator of a test's own: started, switched off and on, killed, and gone with the test.

use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread;

use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

use crate::line::PATIENCE;
use crate::programs::host_sim;
use crate::target::{Need, Target};

/// A running `host-sim`, with settings of its own.
pub struct Simulator {
    process: Child,
    port: PathBuf,
    options: Vec<String>,
    /// Holds the settings and the log; both go with it.
    folder: TempDir,
}

impl Simulator {
    /// Starts one with these options besides its settings file.
    #[must_use]
    pub fn start(options: Vec<String>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (process, port) = launch(folder.path(), &options);
        Self { process, port, options, folder }
    }

    fn signal(&self, signal: Signal) {
        let id = i32::try_from(self.process.id()).ok().and_then(Pid::from_raw).expect("a process id");
        kill_process(id, signal).expect("the simulator is running");
    }

    fn kill(&mut self) {
        // Errors mean that it is gone already, which is what is wanted.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn launch(folder: &Path, options: &[String]) -> (Child, PathBuf) {
    let log = File::options().create(true).append(true).open(folder.join("log")).expect("a log file");
    let mut process = Command::new(host_sim())
        .arg("--eeprom")
        .arg(folder.join("eeprom"))
        .args(options)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(log)
        .spawn()
        .expect("host-sim starts");
    let output = process.stdout.take().expect("a pipe");
    let (sender, first_line) = mpsc::channel();
    // Reads to the end, so that the simulator never writes into a closed pipe.
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

impl Target for Simulator {
    fn port(&self) -> &Path {
        &self.port
    }

    fn lacks(&self, _: Need) -> Option<&'static str> {
        None
    }

    fn power_cycle(&mut self) {
        self.signal(Signal::HUP);
    }

    fn restart_after_kill(&mut self) {
        self.kill();
        (self.process, self.port) = launch(self.folder.path(), &self.options);
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        self.kill();
        if thread::panicking() {
            let log = fs::read_to_string(self.folder.path().join("log")).unwrap_or_default();
            eprintln!("--- what the simulator said ---\n{log}-------------------------------");
        }
    }
}
