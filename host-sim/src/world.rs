//! The arm and everything it touches: host link, controller, servos, settings. Time is a number.
//!
//! ```text
//!   host_sends ──▶ Pacer ──▶ ┌────────────┐ ──▶ Plant
//!                            │ Controller │ ◀──
//!   host_hears ◀── Pacer ◀── └────────────┘ ──▶ Store
//! ```
//!
//! Events happen in the order and at the time of their deadlines, however seldom [`World::advance`] is
//! called: a shell that oversleeps makes the arm neither slower nor its servos late. Knows no clock and no
//! file descriptor.

use embedded_storage::nor_flash::NorFlash;
use motion_core::controller::{Config, Controller, Output};
use motion_core::servo_bus::TorqueCodes;
use motion_core::vacuum::Vacuum;
use protocol_core::registers::RegisterFile;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::deframer::gap;
use tracing::info;

use crate::pace::Pacer;
use crate::plant::Plant;
use crate::store::Store;
use crate::trace::Trace;

/// How long the controller waits for a servo's answer.
const SERVO_TIMEOUT: Duration = Duration::from_millis(5);
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
}

/// An arm with a host link.
#[derive(Debug)]
pub struct World<F> {
    setup: Setup,
    store: Store<F>,
    controller: Controller,
    plant: Plant,
    to_arm: Pacer,
    to_host: Pacer,
    trace: Option<Trace>,
    now: Instant,
    /// When the controller wants to be asked again.
    controller_due: Instant,
}

impl<F: NorFlash + Clone> World<F> {
    /// Switches an arm on at `now`, with the settings that `flash` holds.
    #[must_use]
    pub fn new(now: Instant, setup: Setup, flash: F, plant: Plant) -> Self {
        let (store, controller) = power_up(now, setup, flash);
        let (to_arm, to_host) = (Pacer::new(None), Pacer::new(None));
        let mut world =
            Self { setup, store, controller, plant, to_arm, to_host, trace: None, now, controller_due: now };
        world.start_link();
        world
    }

    /// Switches the arm off and on at `now`: RAM is lost, and what is on the host link; the flash is kept.
    pub fn power_cycle(&mut self, now: Instant) {
        self.advance(now, false);
        self.plant.power_cycle(now);
        (self.store, self.controller) = power_up(now, self.setup, self.store.flash().clone());
        self.controller_due = now;
        self.start_link();
    }

    fn start_link(&mut self) {
        let baud = self.controller.baud();
        info!("arm on, host link at {baud} baud");
        self.to_arm = self.line();
        self.to_host = self.line();
        if let Some(trace) = &mut self.trace {
            trace.restart(gap(baud));
        }
    }

    fn line(&self) -> Pacer {
        Pacer::new(self.setup.is_paced.then(|| self.controller.baud()))
    }

    /// Tells `trace` what goes over the host link from now on.
    pub fn watch(&mut self, mut trace: Trace) {
        trace.restart(gap(self.controller.baud()));
        self.trace = Some(trace);
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
        while let Some(event) = self.next_event().filter(|&event| event < now) {
            self.happen(event, host_is_silent);
        }
        self.happen(now, host_is_silent);
    }

    /// When to call [`World::advance`] next, if nothing comes from outside. What nobody can hear can wait: all
    /// will have happened in its time nevertheless.
    #[must_use]
    pub fn deadline(&self, somebody_listens: bool) -> Instant {
        let link = self.link_deadline().unwrap_or(Instant::FAR_FUTURE).max(self.now);
        let inside = self.plant.deadline().unwrap_or(Instant::FAR_FUTURE).min(self.controller_due);
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
        let candidates = [self.link_deadline(), self.plant.deadline(), Some(self.controller_due)];
        let later = |deadline| if deadline > self.now { deadline } else { self.now + GRAIN };
        candidates.into_iter().flatten().map(later).min()
    }

    fn happen(&mut self, now: Instant, host_is_silent: bool) {
        self.now = now;
        self.to_arm.advance(now);
        self.to_host.advance(now);
        let from_servos = self.plant.poll(now);
        self.controller.servo_bytes(&from_servos);
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
        if let (Some(trace), Some(bytes)) = (&mut self.trace, self.to_arm.arrived().get(..taken)) {
            trace.from_host(self.now, bytes);
        }
        self.to_arm.take(taken);
        taken > 0
    }

    fn controller_hears(&mut self, silence: &[u8; 0]) {
        self.controller.host_bytes(self.now, silence);
        if let Some(trace) = &mut self.trace {
            trace.from_host(self.now, silence);
        }
    }

    /// Carries out what the controller wants until it wants to wait.
    fn run_controller(&mut self) {
        loop {
            match self.controller.poll(self.now, self.to_host.room()) {
                Output::ToHost(bytes) => {
                    if let Some(trace) = &mut self.trace {
                        trace.to_host(self.now, bytes);
                    }
                    self.to_host.push(self.now, bytes);
                }
                Output::ToServos(bytes) => self.plant.bytes(self.now, bytes),
                Output::Vacuum(vacuum) => tell(vacuum),
                Output::Save(image) => {
                    let storage = self.store.save(&image);
                    self.controller.set_storage(storage);
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

fn power_up<F: NorFlash + Clone>(now: Instant, setup: Setup, flash: F) -> (Store<F>, Controller) {
    let (store, stored) = Store::open(flash);
    let config = Config {
        chip_id: setup.chip_id,
        faults: 0,
        servo_timeout: SERVO_TIMEOUT,
        torque_codes: TorqueCodes::default(),
    };
    let controller = Controller::new(now, config, stored.as_ref(), store.state());
    (store, controller)
}

fn tell(vacuum: Vacuum) {
    let pump = if vacuum.pump { "on" } else { "off" };
    let valve = if vacuum.valve { "open" } else { "closed" };
    info!("vacuum: pump {pump}, valve {valve}");
}
