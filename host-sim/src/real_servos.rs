//! The controller on this computer, with real servos behind a USB adapter.
//!
//! ```text
//!   client ◀──▶ Pty ◀──▶ World: the controller ◀──▶ BusLine ◀──▶ Serial ◀──▶ adapter, servos
//! ```
//!
//! In real time: what was missed is not made up for. An adapter that is pulled out is waited for. Nothing but the
//! controller decides what the servos are told, except at the end: then they are damped.

use std::io;
use std::os::fd::AsFd;
use std::path::PathBuf;
use std::thread::sleep;

use embedded_storage::nor_flash::NorFlash;
use motion_core::servo_bus::frame::{FrameBuffer, register, sync_write};
use motion_core::servo_bus::{Torque, TorqueCodes};
use protocol_core::registers::Joint;
use protocol_core::registers::map::MISSING_SERVOS;
use protocol_core::time::{Duration, Instant};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use tracing::{info, warn};

use crate::arm::Arm;
use crate::bus_line::BusLine;
use crate::bus_statistics::{BusStatistics, Figures};
use crate::clients::Clients;
use crate::clock::{Clock, sleep_until};
use crate::serial::Serial;
use crate::signals::{Signals, Wish};

/// Bytes taken from the servo bus at a time.
const PIECE: usize = 4_096;
/// After this long it is told for the first time how the bus does.
const FIRST_REPORT: Duration = Duration::from_millis(2_000);
/// And then again each time this has passed.
const REPORTS: Duration = Duration::from_millis(10_000);
/// How often the port is looked for after the adapter was pulled out.
const SEARCHES: Duration = Duration::from_millis(500);
/// How often the frame that damps the servos is sent at the end, as after a fault of the controller.
const REPEATS: usize = 3;
/// The wire rests so long before each of them: longer than a servo takes to answer.
const PAUSE: std::time::Duration = std::time::Duration::from_millis(5);
/// All seven joints in register 242.
const ALL_MISSING: u8 = 0x7F;

/// Where the servos are, and what becomes of them at the end.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The adapter's port.
    pub port: PathBuf,
    /// The baud rate of the servo bus.
    pub baud: u32,
    /// What the codes of the servos' torque switch mean.
    pub torque_codes: TorqueCodes,
    /// At the end the servos keep their goals and their torque.
    pub holds_on_exit: bool,
}

/// An arm whose servos are real.
#[derive(Debug)]
pub struct RealServos<F> {
    setup: Setup,
    arm: Arm<F, BusLine>,
    clients: Option<Clients>,
    /// `None` while the adapter is unplugged.
    serial: Option<Serial>,
    /// When to look for the port again.
    search_at: Instant,
    statistics: BusStatistics,
    report_at: Instant,
    /// Register 242 as it was last told.
    missing: Option<u8>,
}

impl<F: NorFlash + Clone> RealServos<F> {
    /// Puts an arm in front of the servos behind `serial`.
    #[must_use]
    pub fn new(
        now: Instant,
        setup: Setup,
        arm: Arm<F, BusLine>,
        clients: Option<Clients>,
        serial: Serial,
    ) -> Self {
        tell_opened(&setup, &serial);
        Self {
            setup,
            arm,
            clients,
            serial: Some(serial),
            search_at: now,
            statistics: BusStatistics::new(now),
            report_at: now + FIRST_REPORT,
            missing: None,
        }
    }

    /// Runs until a signal says otherwise, and damps the servos then.
    ///
    /// # Errors
    /// The operating system fails: the host's port, or poll(2).
    pub fn run(mut self, clock: &mut Clock, signals: &mut Signals) -> io::Result<()> {
        let outcome = self.run_until_the_end(clock, signals);
        self.leave();
        outcome
    }

    fn run_until_the_end(&mut self, clock: &mut Clock, signals: &mut Signals) -> io::Result<()> {
        loop {
            let now = clock.now();
            for wish in signals.wishes() {
                match wish {
                    Wish::End => return Ok(()),
                    // The supply of the servos is out of reach.
                    Wish::PowerCycle => self.arm.power_cycle(now),
                    Wish::RestartController => self.arm.restart_controller(now),
                    Wish::Unplug => {}
                }
            }
            self.hear_servos(now);
            // Also when no bytes come: unread reports would keep poll(2) from waiting.
            if let Some(clients) = &mut self.clients {
                clients.look()?;
            }
            let due = self.arm.turn(now, self.clients.as_mut())?;
            self.tell_servos(now);
            self.look_for_port(now);
            self.report(now);
            let due = due.min(self.report_at);
            let due = if self.serial.is_none() { due.min(self.search_at) } else { due };
            self.sleep(clock, due, signals)?;
        }
    }

    fn hear_servos(&mut self, now: Instant) {
        let Some(serial) = &self.serial else { return };
        let mut bytes = [0; PIECE];
        match serial.read(&mut bytes) {
            Ok(count) => {
                let bytes = bytes.get(..count).unwrap_or(&[]);
                self.statistics.heard(now, bytes);
                self.arm.bus().push(bytes);
            }
            Err(error) => self.lose_port(now, &error),
        }
    }

    fn tell_servos(&mut self, now: Instant) {
        let bytes = self.arm.bus().take();
        let Some(serial) = self.serial.as_ref().filter(|_| !bytes.is_empty()) else { return };
        match serial.write(&bytes) {
            Ok(count) if count == bytes.len() => self.statistics.sent(now, &bytes),
            // Half a frame is no frame: the controller sees that nobody answers.
            Ok(_) => warn!("the adapter takes no more bytes: a frame is lost"),
            Err(error) => self.lose_port(now, &error),
        }
    }

    fn lose_port(&mut self, now: Instant, error: &io::Error) {
        let port = self.setup.port.display();
        warn!("{port}: the adapter is gone ({error}): plug it in again; the servos hold what they were told");
        self.serial = None;
        self.search_at = now + SEARCHES;
    }

    /// Opens the port again, but not before the controller has missed every servo: it sends nothing but questions then,
    /// and servos that restarted in the meantime are not driven by goals meant for before.
    fn look_for_port(&mut self, now: Instant) {
        if self.serial.is_some() || now < self.search_at {
            return;
        }
        self.search_at = now + SEARCHES;
        if self.arm.register(MISSING_SERVOS.address) != ALL_MISSING {
            return;
        }
        if let Ok(serial) = Serial::open(&self.setup.port, self.setup.baud) {
            tell_opened(&self.setup, &serial);
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
        self.report_at = now + REPORTS;
        let figures = self.statistics.take(now);
        let missing = self.arm.register(MISSING_SERVOS.address);
        let is_news = self.missing.replace(missing) != Some(missing);
        if is_news && self.serial.is_some() {
            tell_servos_found(&self.setup, missing, &figures);
        }
        info!("servo bus: {} servos, {figures}", (!missing & ALL_MISSING).count_ones());
    }

    /// Damps the servos, unless they are to hold.
    fn leave(&mut self) {
        if self.setup.holds_on_exit {
            return info!("the servos hold their goals, as --hold-on-exit says");
        }
        let Some(serial) = &self.serial else {
            return warn!("the adapter is unplugged: the servos could not be damped");
        };
        let mut frame = FrameBuffer::new();
        let code = self.setup.torque_codes.code(Torque::Damping);
        sync_write(
            &mut frame,
            register::TORQUE_SWITCH,
            Joint::ALL.map(|joint| (joint.index(), [code])).into_iter(),
        );
        for _ in 0..REPEATS {
            // An answer may still be on the wire, and a frame that meets it is lost.
            sleep(PAUSE);
            let sent = serial.write(&frame).and_then(|_| serial.drain());
            if let Err(error) = sent {
                return warn!("the servos could not be damped: {error}");
            }
        }
        info!("state 0: the servos are damped");
    }

    /// Sleeps until something arrives, a client comes or goes, a signal comes, or something is due.
    fn sleep(&self, clock: &mut Clock, due: Instant, signals: &Signals) -> io::Result<()> {
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

fn tell_opened(setup: &Setup, serial: &Serial) {
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
    let table = match setup.torque_codes {
        TorqueCodes::DampingOnFree => "older (0 damping, 1 on, 2 free)",
        TorqueCodes::FreeOnDamping => "current (0 free, 1 on, 2 damping)",
    };
    info!("{}: open at {} baud, {latency}", setup.port.display(), setup.baud);
    info!(
        "register 40 of the servos: {table}, as --torque-codes says; 'sevenbot servo torque-codes' finds out"
    );
}

/// Says which servos were found. Where none was, what the bus carries tells what is wrong.
fn tell_servos_found(setup: &Setup, missing: u8, figures: &Figures) {
    let name = |found: bool| {
        let joints = Joint::ALL.into_iter().filter(|joint| (missing & joint.bit() == 0) == found);
        joints.map(|joint| joint.index().to_string()).collect::<Vec<_>>().join(" ")
    };
    let baud = setup.baud;
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
