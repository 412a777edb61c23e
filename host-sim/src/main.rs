//! The simulator's command line: a 7Bot V2 arm on a pseudo-terminal, until a signal ends it.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;
use host_sim::cli::{Options, in_one_line};
use host_sim::clock::Clock;
use host_sim::eeprom::{Eeprom, ImageError};
use host_sim::link::{Link, LinkError};
use host_sim::plant::Plant;
use host_sim::pty::Pty;
use host_sim::servo_socket::{ServoSocket, SocketError};
use host_sim::shell::Shell;
use host_sim::signals::Signals;
use host_sim::trace::Trace;
use host_sim::world::{Setup, World};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

/// Under this name frames are logged: `--trace` shows them whatever else is shown.
const FRAMES: &str = "frames";

/// Why the simulator did not run, or not to the end.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error(transparent)]
    Socket(#[from] SocketError),
    #[error("no pseudo-terminal: {0}: see that /dev/pts is mounted and has not run out")]
    Port(io::Error),
    #[error("cannot catch signals: {0}")]
    Signals(io::Error),
    #[error("the operating system failed: {0}")]
    Running(io::Error),
}

impl Failure {
    /// The exit status, as `--help` has it.
    const fn status(&self) -> u8 {
        if matches!(self, Self::Running(_)) { 1 } else { 2 }
    }
}

fn main() -> ExitCode {
    let options = match Options::try_parse() {
        Ok(options) => options,
        Err(answer) => return answer_only(&answer),
    };
    log_to_stderr(&options);
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => complain(&failure, failure.status()),
    }
}

/// Says in one line why there is nothing to run, or nothing more.
fn complain(reason: &dyn Display, status: u8) -> ExitCode {
    let _ = writeln!(io::stderr(), "error: {reason}");
    ExitCode::from(status)
}

/// Prints the help or the version that was asked for, or what is wrong with the command line.
fn answer_only(answer: &clap::Error) -> ExitCode {
    if !answer.use_stderr() {
        let _ = answer.print();
        return ExitCode::SUCCESS;
    }
    complain(&in_one_line(answer), 2)
}

fn log_to_stderr(options: &Options) {
    let shown = Targets::new().with_default(options.level());
    let shown = if options.trace { shown.with_target(FRAMES, tracing::Level::INFO) } else { shown };
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(io::stderr)
        .with_ansi(io::stderr().is_terminal())
        .with_timer(tracing_subscriber::fmt::time::uptime())
        .with_target(false)
        // A closed standard error must not end the simulator.
        .log_internal_errors(false);
    tracing_subscriber::registry().with(lines.with_filter(shown)).init();
}

fn run(options: &Options) -> Result<(), Failure> {
    let mut signals = Signals::catch().map_err(Failure::Signals)?;
    let mut clock = Clock::default();
    let mut plant = Plant::new(clock.now());
    options.faults.iter().for_each(|fault| fault.befall(&mut plant));
    match &options.servo_socket {
        Some(path) => run_servos(path, plant, &mut clock, &mut signals),
        None => run_arm(options, plant, &mut clock, &mut signals),
    }
}

fn run_servos(path: &Path, plant: Plant, clock: &mut Clock, signals: &mut Signals) -> Result<(), Failure> {
    let socket = ServoSocket::listen(path)?;
    say_ready(path);
    socket.serve(plant, clock, signals).map_err(Failure::Running)
}

fn run_arm(options: &Options, plant: Plant, clock: &mut Clock, signals: &mut Signals) -> Result<(), Failure> {
    let flash = options.eeprom.as_ref().unwrap_or(&Eeprom::UsersOwn).open()?;
    let pty = Pty::open().map_err(Failure::Port)?;
    let port = pty.path().to_owned();
    // Stands for as long as the shell runs.
    let _link = options.link.as_deref().map(|path| Link::new(path, &port)).transpose()?;
    let setup = Setup { chip_id: options.chip_id, is_paced: !options.unpaced };
    let mut world = World::new(clock.now(), setup, flash, plant);
    if options.trace {
        world.watch(Trace::new(Box::new(|line| tracing::info!(target: FRAMES, "{line}"))));
    }
    say_ready(&port);
    Shell::new(world, pty).run(clock, signals).map_err(Failure::Running)
}

/// The first and only line on standard output. Nobody has to read it.
fn say_ready(path: &Path) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "ready {}", path.display()).and_then(|()| out.flush());
}
