//! Processes under test: start, signals and end.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;

use rustix::process::{Pid, kill_process};

pub use rustix::process::Signal;

use crate::wait::{TIMEOUT, wait_for};

/// Starts a program that prints `ready PORT` for each of its ports, and waits for these lines.
///
/// # Errors
/// Another line, or an empty one after a timeout.
pub fn start(command: &mut Command, ports: usize) -> Result<(Child, Vec<PathBuf>), String> {
    let process = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
    let mut process = process.expect("the program starts");
    let lines = lines(process.stdout.take().expect("a pipe"));
    let port = |_| {
        let line = lines.recv_timeout(TIMEOUT).unwrap_or_default();
        line.strip_prefix("ready ").map(PathBuf::from).ok_or(line)
    };
    let ports = (0..ports).map(port).collect::<Result<_, _>>();
    if ports.is_err() {
        kill(&mut process);
    }
    Ok((process, ports?))
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

/// Waits for the end of a process.
#[track_caller]
pub fn wait_for_exit(process: &mut Child) -> ExitStatus {
    wait_for("the process ends", || {
        process.try_wait().expect("a process to wait for").ok_or_else(|| "it is running".to_owned())
    })
}

/// Kills a process, unless it has ended.
pub fn kill(process: &mut Child) {
    let _ = process.kill();
    let _ = process.wait();
}
