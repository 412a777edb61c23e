//! The arm and everything it touches: host link, controller, servos, settings. Time is a number.
//!
//! ```text
//!   host_sends ──▶ Pacer ──▶ ┌────────────┐ ──▶ Plant
//!                            │ Controller │ ◀──
//!   host_hears ◀── Pacer ◀── └────────────┘ ──▶ Settings
//! ```
//!
//! In the place of the plant there may be a line to real servos: see [`crate::servo_bus`].
//!
//! Events happen in the order and at the time of their deadlines, however seldom [`World::advance`] is
//! called: a shell that oversleeps makes the arm neither slower nor its servos late. Knows no clock and no
//! file descriptor.

use embedded_storage::nor_flash::NorFlash;
use motion_core::servo_bus::TorqueCodes;
use motion_core::vacuum::Vacuum;
use motion_core::{Config, Controller, Output};
use protocol_core::registers::RegisterFile;
use protocol_core::registers::map::fault;
use protocol_core::settings::Settings;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::deframer::gap;
use tracing::info;

use crate::pace::Pacer;
use crate::plant::Plant;
use crate::servo_bus::ServoBus;
use crate::settings_log;

/// How long the controller waits for a servo's answer.
const SERVO_TIMEOUT: Duration = Duration::from_millis(5);
/// How long the controller lets the servo bus rest before each frame: what the reference board does.
const GUARD_TIME: Duration = Duration::from_micros(100);
/// A deadline that stands though it has passed is looked at again after this long, and the shell need not wake up
/// more often than on the stroke of it but for bytes on the line: so many arms wake up together.
const GRAIN: Duration = Duration::from_millis(1);
/// What the host cannot hear can be made up for later: this much later at most.
const UNHEARD_GRAIN: Duration = Duration::from_millis(50);

/// What differs from one simulated arm to another.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// The chip id, most significant byte first (D8).
    pub chip_id: [u8; 6],
    /// Do bytes take their time on the host link?
    pub is_paced: bool,
    /// What the codes of the servos' torque switch mean.
    pub torque_codes: TorqueCodes,
}

/// Sees the bytes on the host link, and changes nothing.
pub trait Tap: std::fmt::Debug {
    /// The link starts, or starts again. `gap` is the idle time by which the arm separates frames (D4).
    fn restart(&mut self, gap: Duration);
    /// The arm took these bytes from the host. No bytes: the host's line is idle at `now`.
    fn received(&mut self, now: Instant, bytes: &[u8]);
    /// The arm sent these bytes to the host.
    fn sent(&mut self, now: Instant, bytes: &[u8]);
}

/// An arm with a host link.
#[derive(Debug)]
pub struct World<F, B = Plant> {
    setup: Setup,
    /// Clones are handles to the same cells.
    flash: F,
    settings: Settings<F>,
    controller: Controller,
    /// What is behind the controller.
    bus: B,
    to_arm: Pacer,
    to_host: Pacer,
    tap: Option<Box<dyn Tap>>,
    now: Instant,
    /// When the controller wants to be asked again.
    controller_due: Instant,
    /// The controller does nothing until it is started again.
    is_halted: bool,
}

impl<F: NorFlash + Clone> World<F> {
    /// The arm itself, to look at.
    #[must_use]
    pub const fn plant(&self) -> &Plant {
        &self.bus
    }

    /// The arm itself, to do something to it.
    pub const fn plant_mut(&mut self) -> &mut Plant {
        &mut self.bus
    }
}

impl<F: NorFlash + Clone, B: ServoBus> World<F, B> {
    /// Switches an arm on at `now`, with the settings that `flash` holds.
    #[must_use]
    pub fn new(now: Instant, setup: Setup, flash: F, bus: B) -> Self {
        let (settings, controller) = power_up(now, setup, flash.clone(), 0, bus.answer_delay());
        let (to_arm, to_host) = (Pacer::new(None), Pacer::new(None));
        let mut world = Self {
            setup,
            flash,
            settings,
            controller,
            bus,
            to_arm,
            to_host,
            tap: None,
            now,
            controller_due: now,
            is_halted: false,
        };
        world.start_link();
        world
    }

    /// Switches the arm off and on at `now`: RAM is lost, and what is on the host link; the flash is kept.
    pub fn power_cycle(&mut self, now: Instant) {
        self.advance(now, false);
        self.bus.power_cycle(now);
        self.start_controller(now, 0);
    }

    /// Restarts only the controller at `now`, as its watchdog does: RAM is lost, and what is on the host link. The
    /// servos keep their power, and with it their torque and their goals.
    pub fn restart_controller(&mut self, now: Instant) {
        self.advance(now, false);
        self.start_controller(now, fault::WATCHDOG_RESTART);
    }

    /// Stops the controller at `now`, as a program that hangs: it sends nothing and hears nothing until
    /// [`World::restart_controller`] or [`World::power_cycle`]. The servos go on with what they were told.
    pub fn halt_controller(&mut self, now: Instant) {
        self.advance(now, false);
        self.is_halted = true;
        self.controller_due = Instant::FAR_FUTURE;
    }

    fn start_controller(&mut self, now: Instant, faults: u8) {
        (self.settings, self.controller) =
            power_up(now, self.setup, self.flash.clone(), faults, self.bus.answer_delay());
        self.controller_due = now;
        self.is_halted = false;
        self.start_link();
    }

    /// The servo bus, for whoever moves its bytes.
    pub const fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    fn start_link(&mut self) {
        let baud = self.controller.baud();
        info!("arm on, host link at {baud} baud");
        self.to_arm = self.line();
        self.to_host = self.line();
        if let Some(tap) = &mut self.tap {
            tap.restart(gap(baud));
        }
    }

    fn line(&self) -> Pacer {
        Pacer::new(self.setup.is_paced.then(|| self.controller.baud()))
    }

    /// Shows `tap` the bytes on the host link from now on.
    pub fn watch(&mut self, mut tap: impl Tap + 'static) {
        tap.restart(gap(self.controller.baud()));
        self.tap = Some(Box::new(tap));
    }

    /// How many bytes the host can send at this moment.
    #[must_use]
    pub fn host_room(&self) -> usize {
        self.to_arm.room()
    }

    /// The host begins to send bytes at `now`; says how many found room.
    pub fn host_sends(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.advance(now, false);
        self.to_arm.push(now, bytes)
    }

    /// Bytes that are through to the host, possibly not all of them at once. They count as there until
    /// [`World::host_heard`] says otherwise, and the arm holds back answers meanwhile (D5).
    #[must_use]
    pub fn host_hears(&self) -> &[u8] {
        self.to_host.arrived()
    }

    /// The host took the first `count` bytes it could hear.
    pub fn host_heard(&mut self, count: usize) {
        self.to_host.take(count);
    }

    /// Nobody listens any more: what is on its way to the host is lost.
    pub fn host_hangs_up(&mut self) {
        self.to_host = self.line();
    }

    /// The registers, to look at.
    #[must_use]
    pub fn registers(&self) -> &RegisterFile {
        self.controller.registers()
    }

    /// Lets everything happen that is due by `now`. `host_is_silent` says that the host has sent nothing
    /// since the last call that was not handed over.
    pub fn advance(&mut self, now: Instant, host_is_silent: bool) {
        // Real servos were not there in the past: an answer that waits to be read has not timed out.
        while !B::IS_REAL
            && let Some(event) = self.next_event().filter(|&event| event < now)
        {
            self.happen(event, host_is_silent);
        }
        self.happen(now, host_is_silent);
    }

    /// When to call [`World::advance`] next, if nothing comes from outside. What nobody can hear can wait: all
    /// will have happened in its time nevertheless.
    #[must_use]
    pub fn deadline(&self, somebody_listens: bool) -> Instant {
        let link = self.link_deadline().unwrap_or(Instant::FAR_FUTURE).max(self.now);
        if B::IS_REAL {
            let later = self.now + GRAIN;
            return link.min(if self.controller_due > self.now { self.controller_due } else { later });
        }
        let inside = self.bus.deadline().unwrap_or(Instant::FAR_FUTURE).min(self.controller_due);
        let unheard = self.now + UNHEARD_GRAIN;
        if somebody_listens {
            let heard = self.controller.host_deadline().max(self.now + GRAIN);
            link.min(stroke(heard.min(inside.max(unheard))))
        } else {
            stroke(link.min(inside).max(unheard))
        }
    }

    fn link_deadline(&self) -> Option<Instant> {
        [self.to_arm.deadline(), self.to_host.deadline()].into_iter().flatten().min()
    }

    /// The next thing to happen after `self.now`. A deadline that has passed and still stands waits for
    /// something else (for silence while bytes are on the line, say) and is looked at again after a while.
    fn next_event(&self) -> Option<Instant> {
        let candidates = [self.link_deadline(), self.bus.deadline(), Some(self.controller_due)];
        let later = |deadline| if deadline > self.now { deadline } else { self.now + GRAIN };
        candidates.into_iter().flatten().map(later).min()
    }

    fn happen(&mut self, now: Instant, host_is_silent: bool) {
        self.now = now;
        self.to_arm.advance(now);
        self.to_host.advance(now);
        let from_servos = self.bus.poll(now);
        if self.is_halted {
            return;
        }
        self.controller.servo_bytes(now, &from_servos);
        if host_is_silent && self.to_arm.is_empty() {
            self.controller_hears(&[]);
        }
        self.run_controller();
        while !self.to_arm.arrived().is_empty() && self.controller_takes_bytes() {
            self.run_controller();
        }
    }

    /// Hands over what has arrived from the host, as much as the controller takes. Says whether it was any.
    fn controller_takes_bytes(&mut self) -> bool {
        let taken = self.controller.host_bytes(self.now, self.to_arm.arrived());
        if let (Some(tap), Some(bytes)) = (&mut self.tap, self.to_arm.arrived().get(..taken)) {
            tap.received(self.now, bytes);
        }
        self.to_arm.take(taken);
        taken > 0
    }

    fn controller_hears(&mut self, silence: &[u8; 0]) {
        self.controller.host_bytes(self.now, silence);
        if let Some(tap) = &mut self.tap {
            tap.received(self.now, silence);
        }
    }

    /// Carries out what the controller wants until it wants to wait.
    fn run_controller(&mut self) {
        loop {
            match self.controller.poll(self.now, self.to_host.room()) {
                Output::ToHost(bytes) => {
                    if let Some(tap) = &mut self.tap {
                        tap.sent(self.now, bytes);
                    }
                    self.to_host.push(self.now, bytes);
                }
                Output::ToServos(bytes) => self.bus.bytes(self.now, bytes),
                Output::Vacuum(vacuum) => tell(vacuum),
                Output::Save(image) => {
                    self.controller.set_storage(self.settings.save(&image));
                    settings_log::saved(&self.settings);
                }
                Output::Wait(until) => {
                    self.controller_due = until;
                    return;
                }
            }
        }
    }
}

/// The first stroke of [`GRAIN`] at or after a time.
fn stroke(at: Instant) -> Instant {
    let micros = at.as_micros().checked_next_multiple_of(GRAIN.as_micros());
    micros.map_or(Instant::FAR_FUTURE, Instant::from_micros)
}

fn power_up<F: NorFlash + Clone>(
    now: Instant,
    setup: Setup,
    flash: F,
    faults: u8,
    answer_delay: Duration,
) -> (Settings<F>, Controller) {
    let settings = Settings::open(flash);
    settings_log::opened(&settings);
    let config = Config {
        chip_id: setup.chip_id,
        faults,
        servo_timeout: SERVO_TIMEOUT,
        guard_time: GUARD_TIME,
        torque_codes: setup.torque_codes,
    };
    let mut controller = Controller::new(now, config, settings.found(), settings.storage());
    controller.set_answer_delay(answer_delay);
    (settings, controller)
}

fn tell(vacuum: Vacuum) {
    let pump = if vacuum.pump { "on" } else { "off" };
    let valve = if vacuum.valve { "open" } else { "closed" };
    info!("vacuum: pump {pump}, valve {valve}");
}
