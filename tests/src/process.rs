//! Programs under test: start, signals and end.

use std::io::{BufRead, BufReader, Read};
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;

use rustix::process::{Pid, kill_process};

pub use rustix::process::Signal;

use crate::wait::{TIMEOUT, wait_for};

/// A program that is killed when it is dropped, so that it does not outlive a test that fails.
#[derive(Debug)]
pub struct RunningProgram {
    /// `None` once [`Self::output`] has taken it.
    child: Option<Child>,
    /// True if the program starts processes of its own, and ends them when it is terminated.
    has_processes: bool,
}

impl RunningProgram {
    /// Starts a program. Panics if the system cannot start it.
    #[must_use]
    pub fn spawn(command: &mut Command) -> Self {
        let child = command.spawn().unwrap_or_else(|error| panic!("{command:?}: {error}"));
        // `xtask emulate` starts the servos and the emulator as processes of its own.
        let has_processes = Path::new(command.get_program()).ends_with("xtask");
        Self { child: Some(child), has_processes }
    }

    /// Waits for the end of the program, and returns what it wrote into its pipes.
    #[must_use]
    pub fn output(mut self) -> Output {
        let child = self.child.take().expect("a running program");
        child.wait_with_output().expect("the program ends")
    }

    /// Kills the program, unless it has ended.
    pub fn kill(&mut self) {
        let Some(child) = &mut self.child else { return };
        // Signal a running process only: after a wait, another process may have its id.
        if self.has_processes && matches!(child.try_wait(), Ok(None)) {
            let _ = kill_process(Pid::from_child(child), Signal::TERM);
            let _ = child.wait();
        }
        let _ = child.kill();
        let _ = child.wait();
    }
}

impl From<Child> for RunningProgram {
    fn from(child: Child) -> Self {
        Self { child: Some(child), has_processes: false }
    }
}

impl Deref for RunningProgram {
    type Target = Child;

    fn deref(&self) -> &Child {
        self.child.as_ref().expect("a running program")
    }
}

impl DerefMut for RunningProgram {
    fn deref_mut(&mut self) -> &mut Child {
        self.child.as_mut().expect("a running program")
    }
}

impl Drop for RunningProgram {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Starts a program that prints `ready PORT` for each of its ports, and waits for these lines.
///
/// # Errors
/// The line that came instead of `ready PORT`. It is empty if no line came before the timeout or the end of the program.
pub fn start(command: &mut Command, ports: usize) -> Result<(RunningProgram, Vec<PathBuf>), String> {
    let mut program = RunningProgram::spawn(command.stdin(Stdio::null()).stdout(Stdio::piped()));
    let lines = lines(program.stdout.take().expect("a pipe"));
    let port = |_| {
        let line = lines.recv_timeout(TIMEOUT).unwrap_or_default();
        line.strip_prefix("ready ").map(PathBuf::from).ok_or(line)
    };
    let ports = (0..ports).map(port).collect::<Result<_, _>>()?;
    Ok((program, ports))
}

/// The lines of a pipe. They are read to the end, so that the program never writes into a closed pipe.
pub fn lines(output: impl Read + Send + 'static) -> Receiver<String> {
    let output = BufReader::new(output);
    let (sender, lines) = mpsc::channel();
    thread::spawn(move || output.lines().map_while(Result::ok).for_each(|line| drop(sender.send(line))));
    lines
}

/// Sends a signal to a running process.
#[track_caller]
pub fn send_signal(process: &Child, signal: Signal) {
    kill_process(Pid::from_child(process), signal).expect("the process is running");
}

/// Resident memory of a process in KiB.
#[must_use]
pub fn kilobytes(process: &Child) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).expect("a status");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number")
}

/// Waits for the end of a process. Panics if it is still running at the time limit.
#[track_caller]
pub fn wait_for_exit(process: &mut Child) -> ExitStatus {
    wait_for("the process ends", || {
        process.try_wait().expect("a process to wait for").ok_or_else(|| "it is running".to_owned())
    })
}
