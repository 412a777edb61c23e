//! The simulator's command line: 7Bot V2 arms on pseudo-terminals, until a signal ends them.

use std::fmt::Display;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use arm_sim::flash::Flash;
use arm_sim::plant::{self, Plant};
use arm_sim::servo_bus::ServoBus;
use arm_sim::world::{Setup, World};
use clap::Parser;
use host_sim::arm::Arm;
use host_sim::bus_line::BusLine;
use host_sim::cli::{Options, in_one_line};
use host_sim::clients::Clients;
use host_sim::clock::Clock;
use host_sim::eeprom::{Eeprom, ImageError};
use host_sim::link::{Link, LinkError};
use host_sim::numbered;
use host_sim::pty::Pty;
use host_sim::real_servos::{self, RealServos};
use host_sim::serial::{Serial, SerialError};
use host_sim::servo_socket::{ServoSocket, SocketError};
use host_sim::servos_only::{self, ServosOnly, ServosOnlyError};
use host_sim::shell::Shell;
use host_sim::signals::Signals;
use host_sim::trace::Trace;
use protocol_core::time::Duration;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tracing::{Span, error_span};
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
    Serial(#[from] SerialError),
    #[error(transparent)]
    Socket(#[from] SocketError),
    #[error("no pseudo-terminal: {0}: see that /dev/pts is mounted and has not run out, nor 'ulimit -n'")]
    Port(io::Error),
    #[error("cannot catch signals: {0}")]
    Signals(io::Error),
    #[error("the operating system failed: {0}")]
    Running(io::Error),
}

impl From<ServosOnlyError> for Failure {
    fn from(error: ServosOnlyError) -> Self {
        match error {
            ServosOnlyError::Link(link) => Self::Link(link),
            ServosOnlyError::System(cause) => Self::Running(cause),
        }
    }
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
    let catch = if options.servos_only { Signals::catch_with_unplug } else { Signals::catch };
    let mut signals = catch().map_err(Failure::Signals)?;
    let mut clock = Clock::default();
    match (&options.servo_socket, &options.servos) {
        (Some(path), _) => run_servo_socket(options, path, &mut clock, &mut signals),
        (None, Some(port)) => run_real_servos(options, port, &mut clock, &mut signals),
        (None, None) if options.servos_only => run_servos_only(options, &mut clock, &mut signals),
        (None, None) => run_arms(options, &mut clock, &mut signals),
    }
}

/// The arm's other half, in the standard pose, with the faults that it was given.
fn plant(options: &Options, clock: &mut Clock) -> Plant {
    let settings = plant::Settings { torque_codes: options.torque_codes, ..plant::Settings::default() };
    let mut plant = Plant::with_settings(clock.now(), settings);
    options.faults.iter().for_each(|fault| fault.befall(&mut plant));
    plant
}

fn run_servo_socket(
    options: &Options,
    path: &Path,
    clock: &mut Clock,
    signals: &mut Signals,
) -> Result<(), Failure> {
    let plant = plant(options, clock);
    let socket = ServoSocket::listen(path)?;
    say_ready(&[path.to_owned()]);
    socket.serve(plant, clock, signals).map_err(Failure::Running)
}

fn run_servos_only(options: &Options, clock: &mut Clock, signals: &mut Signals) -> Result<(), Failure> {
    let mut plant = plant(options, clock);
    if let Some(ids) = &options.ids {
        plant.set_ids(ids);
    }
    let setup = servos_only::Setup {
        link: options.link.clone(),
        baud: options.servo_baud,
        latency: options.usb_latency,
        seed: options.seed,
    };
    let mut servos = ServosOnly::new(setup, plant)?;
    if options.trace {
        servos.watch(|direction, bytes| tracing::info!(target: FRAMES, "{direction} {bytes:02x?}"));
    }
    say_ready(servos.path().as_slice());
    Ok(servos.serve(clock, signals)?)
}

fn run_real_servos(
    options: &Options,
    port: &Path,
    clock: &mut Clock,
    signals: &mut Signals,
) -> Result<(), Failure> {
    let serial = Serial::open(port, options.servo_baud)?;
    let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
    let pty = Pty::open(clients.as_mut()).map_err(Failure::Port)?;
    let path = pty.path().to_owned();
    let _link = options.link.as_ref().map(|link| Link::new(link, &path)).transpose()?;
    let line = BusLine::new(Duration::from_millis(options.usb_timeout.into()));
    let arm = arm(options, None, pty, clock, line)?;
    let setup = real_servos::Setup {
        port: port.to_owned(),
        baud: options.servo_baud,
        torque_codes: options.torque_codes,
        holds_on_exit: options.hold_on_exit,
    };
    let servos = RealServos::new(clock.now(), setup, arm, clients, serial);
    say_ready(&[path]);
    servos.run(clock, signals).map_err(Failure::Running)
}

fn run_arms(options: &Options, clock: &mut Clock, signals: &mut Signals) -> Result<(), Failure> {
    let numbers = options.arms.map_or(vec![None], |count| (1..=count).map(Some).collect());
    if numbers.len() > 1 {
        allow_as_many_files_as_possible();
    }
    let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
    let mut arms = Vec::with_capacity(numbers.len());
    let mut ports = Vec::with_capacity(numbers.len());
    // They stand for as long as the shell runs.
    let mut links = Vec::new();
    for number in numbers {
        let pty = Pty::open(clients.as_mut()).map_err(Failure::Port)?;
        let port = pty.path().to_owned();
        if let Some(link) = &options.link {
            links.push(Link::new(&numbered::path(link, number), &port)?);
        }
        ports.push(port);
        let plant = plant(options, clock);
        arms.push(arm(options, number, pty, clock, plant)?);
    }
    let shell = Shell::new(arms, clients).map_err(Failure::Running)?;
    say_ready(&ports);
    shell.run(clock, signals).map_err(Failure::Running)
}

/// Switches an arm on.
fn arm<B: ServoBus>(
    options: &Options,
    number: Option<u16>,
    pty: Pty,
    clock: &mut Clock,
    bus: B,
) -> Result<Arm<Flash, B>, Failure> {
    // An error, so that whatever is shown is shown with it.
    let span = number.map_or_else(Span::none, |number| error_span!("arm", number));
    let inside = span.enter();
    let default = if options.servos.is_some() { Eeprom::REAL_SERVOS } else { Eeprom::SIMULATED };
    let flash = options.eeprom.as_ref().unwrap_or(&default).open(number)?;
    let chip_id = numbered::chip_id(options.chip_id, number);
    let setup = Setup { chip_id, is_paced: !options.unpaced, torque_codes: options.torque_codes };
    let mut world = World::new(clock.now(), setup, flash, bus);
    if options.trace {
        world.watch(Trace::new(Box::new(|line| tracing::info!(target: FRAMES, "{line}"))));
    }
    drop(inside);
    Ok(Arm::new(world, pty, span))
}

/// An arm takes three open files, and a process may have 1024 unless it asks for more. If that is not enough, the
/// first arm that finds none says so.
fn allow_as_many_files_as_possible() {
    let limit = getrlimit(Resource::Nofile);
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// The first and only lines on standard output, one a port. Nobody has to read them.
fn say_ready(ports: &[PathBuf]) {
    let mut out = BufWriter::new(io::stdout().lock());
    let written = ports.iter().try_for_each(|port| writeln!(out, "ready {}", port.display()));
    let _ = written.and_then(|()| out.flush());
}
