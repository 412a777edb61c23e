//! The controller on this computer, with real servos behind a USB adapter.
//!
//! ```text
//!   client ◀──▶ Pty ◀──▶ SimulatedArm: the controller ◀──▶ BusLine ◀──▶ Serial ◀──▶ adapter, servos
//! ```
//!
//! This runs in real time: a late poll does not catch up. If the adapter is unplugged, the program waits for it. Only
//! the controller sends frames to the servos, except at the end, when the servos are damped.

use std::io;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::thread::sleep;

use embedded_storage::nor_flash::NorFlash;
use motion_core::servo_bus::frame::{ServoFrameBuffer, register, sync_write};
use motion_core::servo_bus::{Torque, TorqueCodes};
use protocol_core::registers::Joint;
use protocol_core::registers::map::MISSING_SERVOS;
use protocol_core::time::{Duration, Instant};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use tracing::{info, warn};

use crate::bus_line::BusLine;
use crate::bus_statistics::{BusStatistics, Figures};
use crate::clock::{RealClock, sleep_until};
use crate::pty_arm::PtyArm;
use crate::signals::{SignalAction, Signals};
use tty_ports::clients::Clients;
use tty_ports::serial::Serial;

/// Bytes per read from the servo bus.
const PIECE: usize = 4_096;
/// The first line about the servo bus is logged after this time.
const FIRST_REPORT: Duration = Duration::from_millis(2_000);
/// The period of the lines about the servo bus.
const REPORT_PERIOD: Duration = Duration::from_millis(10_000);
/// The period of attempts to open the port after the adapter was unplugged.
const SEARCH_PERIOD: Duration = Duration::from_millis(500);
/// The frame that damps the servos is sent this many times, because a frame that collides with an answer is lost.
const REPEATS: usize = 3;
/// The pause before each of these frames: longer than a servo needs to answer.
const PAUSE: std::time::Duration = std::time::Duration::from_millis(5);
/// Register 242 if all joints are missing.
const ALL_MISSING: u8 = 0x7F;

/// The port and the settings of the servo bus.
#[derive(Clone, Debug)]
pub struct BusConfig {
    /// The serial port of the USB adapter.
    pub port: PathBuf,
    /// The baud rate of the servo bus.
    pub baud: u32,
    /// The meaning of the codes in the servos' torque switch.
    pub torque_codes: TorqueCodes,
    /// At the end the servos keep goals and torque.
    pub holds_on_exit: bool,
}

/// An arm whose servos are real.
#[derive(Debug)]
pub struct RealServos<F> {
    config: BusConfig,
    arm: PtyArm<F, BusLine>,
    clients: Option<Clients>,
    /// `None` while the adapter is unplugged.
    serial: Option<Serial>,
    /// When to try to open the port again.
    search_at: Instant,
    statistics: BusStatistics,
    report_at: Instant,
    /// Register 242 at the last line about the servo bus; `None` before the first line since the port was opened.
    missing: Option<u8>,
}

impl<F: NorFlash + Clone> RealServos<F> {
    /// Connects an arm to the servos on `serial`.
    #[must_use]
    pub fn new(
        now: Instant,
        config: BusConfig,
        arm: PtyArm<F, BusLine>,
        clients: Option<Clients>,
        serial: Serial,
    ) -> Self {
        log_opened(&config, &serial);
        Self {
            config,
            arm,
            clients,
            serial: Some(serial),
            search_at: now,
            statistics: BusStatistics::new(now),
            report_at: now + FIRST_REPORT,
            missing: None,
        }
    }

    /// Runs until a signal or an error ends it. Then damps the servos, unless [`BusConfig::holds_on_exit`] is set.
    ///
    /// # Errors
    /// The operating system fails: the host's port, inotify or poll(2).
    pub fn run(mut self, clock: &mut RealClock, signals: &mut Signals) -> io::Result<()> {
        let result = self.run_loop(clock, signals);
        self.damp_servos();
        result
    }

    fn run_loop(&mut self, clock: &mut RealClock, signals: &mut Signals) -> io::Result<()> {
        loop {
            let now = clock.now();
            for action in signals.actions() {
                match action {
                    SignalAction::End => return Ok(()),
                    // The servos keep their power, because this program cannot switch their supply.
                    SignalAction::PowerCycle => self.arm.power_cycle(now),
                    SignalAction::RestartController => self.arm.restart_controller(now),
                    SignalAction::Unplug => Signals::warn_of_unplug(),
                }
            }
            self.read_bus(now);
            // Read the reports of inotify in each turn, because poll(2) does not wait while a report is unread.
            if let Some(clients) = &mut self.clients {
                clients.update()?;
            }
            let due = self.arm.poll(now, self.clients.as_mut())?;
            self.write_bus(now);
            self.look_for_port(now);
            self.report(now);
            let due = due.min(self.report_at);
            let due = if self.serial.is_none() { due.min(self.search_at) } else { due };
            self.sleep(clock, due, signals)?;
        }
    }

    fn read_bus(&mut self, now: Instant) {
        let Some(serial) = &self.serial else { return };
        let mut bytes = [0; PIECE];
        match serial.read(&mut bytes) {
            Ok(count) => {
                let bytes = bytes.get(..count).unwrap_or(&[]);
                self.statistics.received(now, bytes);
                self.arm.bus().push(bytes);
            }
            Err(error) => self.lose_port(now, &error),
        }
    }

    fn write_bus(&mut self, now: Instant) {
        let bytes = self.arm.bus().take();
        let Some(serial) = self.serial.as_ref().filter(|_| !bytes.is_empty()) else { return };
        match serial.write(&bytes) {
            Ok(count) if count == bytes.len() => self.statistics.sent(now, &bytes),
            // The controller notices a lost question: its answer is missing.
            Ok(_) => warn!("the adapter takes no more bytes: a frame is lost"),
            Err(error) => self.lose_port(now, &error),
        }
    }

    fn lose_port(&mut self, now: Instant, error: &io::Error) {
        let port = self.config.port.display();
        warn!("{port}: the adapter is gone ({error}): plug it in again; the servos hold what they were told");
        self.serial = None;
        self.search_at = now + SEARCH_PERIOD;
    }

    /// Opens the port again, but only after the controller has flagged every servo as missing. From then on the controller
    /// sends only questions, so a servo that has restarted does not get an old goal (D12).
    fn look_for_port(&mut self, now: Instant) {
        if self.serial.is_some() || now < self.search_at {
            return;
        }
        self.search_at = now + SEARCH_PERIOD;
        if self.arm.register(MISSING_SERVOS.address) != ALL_MISSING {
            return;
        }
        if let Ok(serial) = Serial::open(&self.config.port, self.config.baud) {
            log_opened(&self.config, &serial);
            self.serial = Some(serial);
            self.statistics = BusStatistics::new(now);
            self.report_at = now + FIRST_REPORT;
            self.missing = None;
        }
    }

    fn report(&mut self, now: Instant) {
        if now < self.report_at {
            return;
        }
        self.report_at = now + REPORT_PERIOD;
        let figures = self.statistics.take(now);
        let missing = self.arm.register(MISSING_SERVOS.address);
        let has_changed = self.missing.replace(missing) != Some(missing);
        if has_changed && self.serial.is_some() {
            log_servos_found(&self.config, missing, &figures);
        }
        info!("servo bus: {} servos, {figures}", (!missing & ALL_MISSING).count_ones());
    }

    /// Damps the servos, unless [`BusConfig::holds_on_exit`] is set.
    fn damp_servos(&self) {
        if self.config.holds_on_exit {
            return info!("the servos hold their goals, as --hold-on-exit says");
        }
        let Some(serial) = &self.serial else {
            return warn!("the adapter is unplugged: the servos could not be damped");
        };
        let mut frame = ServoFrameBuffer::new();
        let code = self.config.torque_codes.code(Torque::Damping);
        sync_write(
            &mut frame,
            register::TORQUE_SWITCH,
            Joint::ALL.map(|joint| (joint.index(), [code])).into_iter(),
        );
        for _ in 0..REPEATS {
            sleep(PAUSE);
            let sent = serial.write(&frame).and_then(|_| serial.drain());
            if let Err(error) = sent {
                return warn!("the servos could not be damped: {error}");
            }
        }
        info!("state 0: the servos are damped");
    }

    /// Sleeps until `due`, until bytes arrive, until a client comes or goes, or until a signal comes.
    fn sleep(&self, clock: &mut RealClock, due: Instant, signals: &Signals) -> io::Result<()> {
        let time = sleep_until(clock.now(), due);
        let signals = signals.as_fd();
        let serial = self.serial.as_ref().map_or(signals, AsFd::as_fd);
        let clients = self.clients.as_ref().map_or(signals, AsFd::as_fd);
        let mut wanted = [
            PollFd::from_borrowed_fd(serial, PollFlags::IN),
            PollFd::from_borrowed_fd(clients, PollFlags::IN),
            PollFd::from_borrowed_fd(signals, PollFlags::IN),
            PollFd::from_borrowed_fd(self.arm.as_fd(), self.arm.poll_interest()),
        ];
        match poll(&mut wanted, Some(&time)) {
            Ok(_) | Err(Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

fn log_opened(config: &BusConfig, serial: &Serial) {
    let latency = match serial.latency() {
        None => "no latency timer found (fine with CH340, CH343, CP210x and CDC adapters)".to_owned(),
        Some(timer) if timer.now <= 1 => {
            format!("latency timer {} ms (found at {} ms)", timer.now, timer.found)
        }
        Some(timer) => format!(
            "latency timer {} ms, slow: as root, echo 1 > /sys/bus/usb-serial/devices/PORT/latency_timer",
            timer.now
        ),
    };
    let table = match config.torque_codes {
        TorqueCodes::DampingOnFree => "older (0 damping, 1 on, 2 free)",
        TorqueCodes::FreeOnDamping => "current (0 free, 1 on, 2 damping)",
    };
    info!("{}: open at {} baud, {latency}", config.port.display(), config.baud);
    info!(
        "register 40 of the servos: {table}, as --torque-codes says; 'sevenbot servo torque-codes' finds out"
    );
}

/// Logs which servos were found. If no servo answers, the advice depends on whether bytes were received.
fn log_servos_found(config: &BusConfig, missing: u8, figures: &Figures) {
    let name = |found: bool| {
        let joints = Joint::ALL.into_iter().filter(|joint| (missing & joint.bit() == 0) == found);
        joints.map(|joint| joint.index().to_string()).collect::<Vec<_>>().join(" ")
    };
    let baud = config.baud;
    if missing == ALL_MISSING && figures.bytes == 0 {
        warn!(
            "no servo answers at {baud} baud, and nothing comes back at all: is the servos' supply on, the cable plugged in? 'sevenbot servo scan' tries all baud rates"
        );
    } else if missing == ALL_MISSING {
        warn!(
            "no servo answers at {baud} baud, but bytes come (an echo, or another baud rate): is the servos' supply on? 'sevenbot servo scan' finds the rate for --servo-baud"
        );
    } else if missing != 0 {
        warn!(
            "servos found: ids {}; missing: ids {} (joint n has id n-1; 'sevenbot servo set-id' changes one)",
            name(true),
            name(false)
        );
    } else {
        info!("servos found: ids {}", name(true));
    }
}
