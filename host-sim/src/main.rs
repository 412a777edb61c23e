//! The program `host-sim`: runs arms, or servos without a controller, until a signal ends it; or replays a session.

mod failure;

use std::fmt::Display;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use arm_sim::Action;
use arm_sim::controller::ArmController;
use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::servo::ServoConfig;
use arm_sim::servo_bus::ServoBus;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use arm_sim::stock_controller::StockController;
use clap::Parser;
use host_sim::angle_log::AngleLog;
use host_sim::bus_line::BusLine;
use host_sim::cli::{Options, in_one_line};
use host_sim::clock::RealClock;
use host_sim::control::{self, socket::ControlSocket};
use host_sim::eeprom::Eeprom;
use host_sim::event_loop::EventLoop;
use host_sim::image_file::ImageFile;
use host_sim::per_arm;
use host_sim::private_socket::SocketError;
use host_sim::pty_arm::PtyArm;
use host_sim::real_servos::{self, RealServos};
use host_sim::servo_socket::ServoSocket;
use host_sim::servos_only::{self, ServosOnly};
use host_sim::session_file::{self, SessionFile};
use host_sim::signals::Signals;
use host_sim::trace::Trace;
use host_sim::virtual_clock::VirtualClock;
use motion_core::Controller;
use protocol_core::time::{Duration, Instant};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tracing::{Span, error_span, info, warn};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;
use tty_ports::clients::Clients;
use tty_ports::pty::Pty;
use tty_ports::serial::Serial;
use tty_ports::symlink::{Symlink, SymlinkError};

use failure::Failure;

/// The log target of frames. `--trace` shows it at any log level.
const FRAMES: &str = "frames";

/// With --lockstep, virtual time starts at 1 s, when the servos have already started: before the first byte, virtual time hardly
/// passes.
const LOCKSTEP_START: Instant = Instant::from_micros(1_000_000);

fn main() -> ExitCode {
    let options = match Options::try_parse() {
        Ok(options) => options,
        Err(error) => return print_help_or_error(&error),
    };
    log_to_stderr(&options);
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => print_error(&failure, failure.status()),
    }
}

fn print_error(reason: &dyn Display, status: u8) -> ExitCode {
    let _ = writeln!(io::stderr(), "error: {reason}");
    ExitCode::from(status)
}

/// Prints the help, the version, or the error in the command line.
fn print_help_or_error(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    print_error(&in_one_line(error), 2)
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
    if let Some(path) = &options.replay {
        let lines = session_file::replay(path)?;
        // Ignore an error: standard output may be closed.
        let _ = writeln!(io::stdout(), "{}: {lines} lines replayed, all equal", path.display());
        return Ok(());
    }
    let mut signals = Signals::catch().map_err(Failure::Signals)?;
    let mut clock = RealClock::default();
    match (&options.servo_socket, &options.servos) {
        (Some(path), _) => run_servo_socket(options, path, &mut clock, &mut signals),
        (None, Some(port)) => run_real_servos(options, port, &mut clock, &mut signals),
        (None, None) if options.servos_only => run_servos_only(options, &mut clock, &mut signals),
        (None, None) if options.as_maker.is_some() => run_arms::<StockController>(options, &mut signals),
        (None, None) => run_arms::<Controller>(options, &mut signals),
    }
}

/// The simulated servos for a run without a controller. Refuses faults that only an arm with a controller can have.
fn plant_alone(options: &Options, clock: &mut RealClock) -> Result<Plant, Failure> {
    match options.faults.iter().find(|fault| !fault.is_of_plant()) {
        Some(&fault) => Err(Failure::FaultOfController(fault)),
        None => Ok(plant(options, clock.now())),
    }
}

/// The simulated servos in the standard pose, with the faults of the command line.
fn plant(options: &Options, now: Instant) -> Plant {
    let config = ServoConfig { torque_codes: options.torque_codes, ..ServoConfig::default() };
    let mut plant = Plant::with_config(now, config);
    options.faults.iter().for_each(|fault| fault.apply(&mut plant));
    plant
}

fn run_servo_socket(
    options: &Options,
    path: &Path,
    clock: &mut RealClock,
    signals: &mut Signals,
) -> Result<(), Failure> {
    let plant = plant_alone(options, clock)?;
    let log = |path: &PathBuf| {
        AngleLog::create(path).map_err(|cause| Failure::Angles { path: path.clone(), cause })
    };
    let angles = options.angles.as_ref().map(log).transpose()?;
    let socket = ServoSocket::listen(path, angles)?;
    print_ready(&[path.to_owned()]);
    socket.serve(plant, clock, signals).map_err(Failure::Running)
}

fn run_servos_only(options: &Options, clock: &mut RealClock, signals: &mut Signals) -> Result<(), Failure> {
    let mut plant = plant_alone(options, clock)?;
    if let Some(ids) = &options.ids {
        plant.set_ids(ids);
    }
    let config = servos_only::AdapterConfig {
        link: options.link.clone(),
        baud: options.servo_baud,
        latency: options.usb_latency,
        seed: options.seed,
    };
    let mut servos = ServosOnly::new(config, plant)?;
    if options.trace {
        servos.set_trace(|direction, bytes| tracing::info!(target: FRAMES, "{direction} {bytes:02x?}"));
    }
    print_ready(servos.path().as_slice());
    Ok(servos.serve(clock, signals)?)
}

fn run_real_servos(
    options: &Options,
    port: &Path,
    clock: &mut RealClock,
    signals: &mut Signals,
) -> Result<(), Failure> {
    let serial = Serial::open(port, options.servo_baud)?;
    let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
    let pty = Pty::open(clients.as_mut()).map_err(Failure::Port)?;
    let path = pty.path().to_owned();
    let line = BusLine::new(options.servo_baud, Duration::from_millis(options.usb_timeout.into()));
    let arm = arm::<_, Controller>(options, None, pty, flash(options, None)?, clock.now(), line);
    let config = real_servos::BusConfig {
        port: port.to_owned(),
        baud: options.servo_baud,
        torque_codes: options.torque_codes,
        holds_on_exit: options.hold_on_exit,
    };
    let servos = RealServos::new(clock.now(), config, arm, clients, serial);
    let _symlink = options.link.as_ref().map(|link| Symlink::new(link, &path)).transpose()?;
    print_ready(&[path]);
    servos.run(clock, signals).map_err(Failure::Running)
}

fn run_arms<C: ArmController>(options: &Options, signals: &mut Signals) -> Result<(), Failure> {
    let mut clock = match options.lockstep {
        None => VirtualClock::default(),
        Some(millis) => VirtualClock::in_lockstep(LOCKSTEP_START, Duration::from_millis(millis.into())),
    };
    let numbers = options.arms.map_or(vec![None], |count| (1..=count).map(Some).collect());
    clock.set_shared(numbers.len() > 1);
    if numbers.len() > 1 {
        allow_as_many_files_as_possible();
    }
    let mut clients = Clients::new().inspect_err(Pty::warn_of).ok();
    let mut ports = Vec::with_capacity(numbers.len());
    for &number in &numbers {
        ports.push((Pty::open(clients.as_mut()).map_err(Failure::Port)?, flash(options, number)?));
    }
    let paths: Vec<PathBuf> = ports.iter().map(|(pty, _)| pty.path().to_owned()).collect();
    // Dropping the links removes them, so keep them while the loop runs.
    let _symlinks = symlinks(options, &numbers, &paths)?;
    let arms = numbers.iter().zip(ports);
    let arms = arms.map(|(&number, (pty, flash))| simulated_arm::<C>(options, number, pty, flash, &clock));
    let arms = arms.collect::<Result<_, _>>()?;
    let mut event_loop = EventLoop::new(arms, clients).map_err(Failure::Running)?;
    event_loop.add_controls(control_sockets(options, &numbers)?).map_err(Failure::Running)?;
    print_ready(&paths);
    event_loop.run(&mut clock, signals).map_err(Failure::Running)
}

/// An arm with simulated servos, and its recorder.
fn simulated_arm<C: ArmController>(
    options: &Options,
    number: Option<u16>,
    pty: Pty,
    mut flash: Flash<ImageFile>,
    clock: &VirtualClock,
) -> Result<PtyArm<Flash<ImageFile>, Plant, C>, Failure> {
    let seed = options.seed.wrapping_add(number.unwrap_or(0).into());
    let servos = ServoConfig { torque_codes: options.torque_codes, ..ServoConfig::default() };
    let plant = Plant::with_config(Instant::ZERO, servos);
    let settings = flash.cells_mut().copy();
    let mut arm = arm::<_, C>(options, number, pty, flash, Instant::ZERO, plant);
    arm.set_seed(seed);
    if options.strict_baud {
        arm.set_strict_baud();
    }
    if clock.is_in_lockstep() {
        arm.simulation_mut().set_bytewise_line();
    }
    if let Some(path) = &options.record {
        let header = session_file::header(options, number, seed, &settings);
        let file = SessionFile::create(&per_arm::path(path, number), &header, options.force)?;
        arm.simulation_mut().set_recorder(file);
    }
    options.faults.iter().for_each(|&fault| arm.set_fault(Instant::ZERO, fault));
    if let Some(scene) = &options.scene {
        arm.act(Instant::ZERO, Action::Scene(Some(scene.clone())));
    }
    arm.simulation_mut().advance(clock.now(), true);
    Ok(arm)
}

fn symlinks(
    options: &Options,
    numbers: &[Option<u16>],
    ports: &[PathBuf],
) -> Result<Vec<Symlink>, SymlinkError> {
    let Some(link) = &options.link else { return Ok(Vec::new()) };
    numbers
        .iter()
        .zip(ports)
        .map(|(&number, port)| Symlink::new(&per_arm::path(link, number), port))
        .collect()
}

/// The control sockets of the arms. An arm whose default socket cannot be created has none. If the socket at an explicit path
/// cannot be created, the program ends.
fn control_sockets(
    options: &Options,
    numbers: &[Option<u16>],
) -> Result<Vec<Option<ControlSocket>>, Failure> {
    let listen = |path: &Path, number: Option<u16>| {
        let socket = ControlSocket::listen(&per_arm::path(path, number))?;
        info!("control socket {}", socket.path().display());
        Ok::<_, SocketError>(socket)
    };
    match &options.control {
        Some(path) if path.as_os_str() == "none" => Ok(Vec::new()),
        Some(path) => numbers.iter().map(|&number| Ok(Some(listen(path, number)?))).collect(),
        None => {
            let default = control::path::default();
            let path = default.inspect_err(|cause| warn!("no control socket: {cause}: see --control")).ok();
            let warned = |error: &SocketError| warn!("no control socket: {error}");
            let listen = |number| listen(path.as_ref()?, number).inspect_err(warned).ok();
            Ok(numbers.iter().map(|&number| listen(number)).collect())
        }
    }
}

/// Switches an arm on.
fn arm<B: ServoBus, C: ArmController>(
    options: &Options,
    number: Option<u16>,
    pty: Pty,
    flash: Flash<ImageFile>,
    now: Instant,
    bus: B,
) -> PtyArm<Flash<ImageFile>, B, C> {
    // The span has level error, so that every log level shows it.
    let span = number.map_or_else(Span::none, |number| error_span!("arm", number));
    let inside = span.enter();
    let chip_id = per_arm::chip_id(options.chip_id, number);
    let config = ArmConfig { chip_id, is_paced: !options.unpaced, torque_codes: options.torque_codes };
    let mut simulation = SimulatedArm::power_up(now, config, flash, bus);
    if options.trace {
        simulation.set_tap(Trace::new(Box::new(|line| tracing::info!(target: FRAMES, "{line}"))));
    }
    drop(inside);
    PtyArm::new(simulation, pty, span)
}

/// The flash with the settings of an arm.
fn flash(options: &Options, number: Option<u16>) -> Result<Flash<ImageFile>, Failure> {
    let default = match (&options.servos, &options.as_maker) {
        (Some(_), _) => Eeprom::REAL_SERVOS,
        (None, Some(_)) => Eeprom::STOCK,
        (None, None) => Eeprom::SIMULATED,
    };
    Ok(options.eeprom.as_ref().unwrap_or(&default).open(number)?)
}

/// Raises the limit of open files to the highest value that the system allows. An arm needs two for its port, and one each for
/// the settings, the control socket and the recording. If the limit is too low, opening one of them fails.
fn allow_as_many_files_as_possible() {
    let limit = getrlimit(Resource::Nofile);
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// Prints one line per port to standard output. Errors are ignored: a reader of these lines is optional.
fn print_ready(ports: &[PathBuf]) {
    let mut out = BufWriter::new(io::stdout().lock());
    let written = ports.iter().try_for_each(|port| writeln!(out, "ready {}", port.display()));
    let _ = written.and_then(|()| out.flush());
}
