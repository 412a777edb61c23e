//! An arm in virtual time: host line, controller, servo bus and settings.
//!
//! ```text
//!   host_send ────▶ Pacer ──▶ ┌────────────┐ ──▶ ServoBus: Plant, or real servos
//!                             │ controller │ ◀──
//!   host_received ◀─ Pacer ◀─ └────────────┘ ──▶ Settings
//! ```
//!
//! With simulated servos, the simulation advances from event to event, and processes each event at its own time. So the result
//! does not depend on how often [`SimulatedArm::advance`] is called: a late call slows down neither the arm nor its servos. With
//! real servos, each call processes the present time only.

use alloc::boxed::Box;

use embedded_storage::nor_flash::NorFlash;
use motion_core::servo_bus::TorqueCodes;
use motion_core::vacuum::Vacuum;
use motion_core::{Config, Controller, Output};
use protocol_core::registers::RegisterFile;
use protocol_core::request::Request;
use protocol_core::settings::Settings;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;
use protocol_core::wire::deframer::gap;
use tracing::info;

use crate::action::Action;
use crate::controller::ArmController;
use crate::faults::list::{EndedFaults, FaultList};
use crate::faulty_flash::FaultyFlash;
use crate::host_line::LineDirection;
use crate::plant::Plant;
use crate::servo_bus::ServoBus;
use crate::session::SessionRecorder;
use crate::settings_log;
use crate::tap::{Tap, Watcher};

mod act;
mod deadlines;
mod disturbance;
mod power;
mod record;
mod snapshot;

/// How long the controller waits for a servo's answer, without the delay of a USB adapter.
const SERVO_TIMEOUT: Duration = Duration::from_millis(5);
/// The pause of the controller before each frame on the servo bus, as on the reference board.
const GUARD_TIME: Duration = Duration::from_micros(100);
/// The configuration of a simulated arm.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ArmConfig {
    /// The chip id, most significant byte first ([D8](protocol_core::decisions#d8)).
    pub chip_id: [u8; 6],
    /// Bytes on the host line take the time that the baud rate requires. Otherwise they arrive at once.
    pub is_paced: bool,
    /// The meaning of the codes in the servos' torque switch.
    pub torque_codes: TorqueCodes,
}

/// An arm with a host line, with settings on the flash `F`, servos on the bus `B` and the controller `C`.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SimulatedArm<F, B = Plant, C = Controller> {
    config: ArmConfig,
    settings: Settings<FaultyFlash<F>>,
    controller: C,
    bus: B,
    to_arm: LineDirection,
    to_host: LineDirection,
    #[cfg_attr(feature = "serde", serde(skip))]
    tap: Watcher<dyn Tap>,
    #[cfg_attr(feature = "serde", serde(skip))]
    recorder: Watcher<dyn SessionRecorder>,
    now: Instant,
    /// When the controller has to be polled again.
    controller_due: Instant,
    /// The controller does nothing until it is restarted.
    is_halted: bool,
    is_off: bool,
    faults: FaultList,
    ended_faults: EndedFaults,
    /// The host has disconnected, and this many of its bytes are still on the line to the arm. `None`: no host is leaving.
    leaving: Option<usize>,
}

impl<F: NorFlash, C: ArmController> SimulatedArm<F, Plant, C> {
    /// The simulated servos.
    #[must_use]
    pub const fn plant(&self) -> &Plant {
        &self.bus
    }

    /// The simulated servos, for example to set a fault.
    pub const fn plant_mut(&mut self) -> &mut Plant {
        &mut self.bus
    }
}

impl<F: NorFlash, B: ServoBus> SimulatedArm<F, B> {
    /// Switches an arm with this project's controller on at `now`, with the settings on `flash`.
    #[must_use]
    pub fn new(now: Instant, config: ArmConfig, flash: F, bus: B) -> Self {
        Self::power_up(now, config, flash, bus)
    }

    /// The register file of the controller.
    #[must_use]
    pub fn registers(&self) -> &RegisterFile {
        self.controller.registers()
    }
}

impl<F: NorFlash, B: ServoBus, C: ArmController> SimulatedArm<F, B, C> {
    /// Switches an arm on at `now`, with the settings on `flash`.
    #[must_use]
    pub fn power_up(now: Instant, config: ArmConfig, flash: F, bus: B) -> Self {
        let settings = Settings::open(FaultyFlash::new(flash));
        let controller = start(now, config, &settings, 0, &bus);
        let (to_arm, to_host) = LineDirection::pair(1);
        let mut simulation = Self {
            config,
            settings,
            controller,
            bus,
            to_arm,
            to_host,
            tap: Watcher::default(),
            recorder: Watcher::default(),
            now,
            controller_due: now,
            is_halted: false,
            is_off: false,
            faults: FaultList::default(),
            ended_faults: EndedFaults::default(),
            leaving: None,
        };
        simulation.start_host_line();
        simulation.process(now, false);
        simulation
    }

    /// The flash with the settings.
    pub const fn flash_mut(&mut self) -> &mut F {
        &mut self.settings.flash_mut().flash
    }

    /// The servo bus, for example to pass it the bytes of real servos.
    pub const fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    fn start_host_line(&mut self) {
        let baud = self.controller.baud();
        info!("arm on, host link at {baud} baud");
        self.clear_host_line();
        if let Some(tap) = self.tap.get() {
            tap.restart(gap(baud));
        }
    }

    /// Drops the bytes on the host line.
    fn clear_host_line(&mut self) {
        let baud = self.paced_baud();
        self.to_arm.clear(baud);
        self.to_host.clear(baud);
    }

    /// The baud rate of the host link, in bits per second.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.controller.baud()
    }

    /// Sets whether bytes on the host line take the time that the baud rate requires. A change drops the bytes on the line.
    pub(crate) fn set_paced(&mut self, is_paced: bool) {
        if self.config.is_paced != is_paced {
            self.config.is_paced = is_paced;
            self.clear_host_line();
        }
    }

    /// Do bytes on the host line take the time that the baud rate requires?
    pub(crate) const fn is_paced(&self) -> bool {
        self.config.is_paced
    }

    fn paced_baud(&self) -> Option<u32> {
        self.config.is_paced.then(|| self.controller.baud())
    }

    /// Copies the bytes on the host line to `tap` from now on. Calls [`Tap::restart`] first.
    pub fn set_tap(&mut self, mut tap: impl Tap + 'static) {
        tap.restart(gap(self.controller.baud()));
        self.tap = Watcher::holding(Box::new(tap));
    }

    /// The time up to which the arm is simulated.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Number of bytes that the host can send now.
    #[must_use]
    pub fn host_room(&self) -> usize {
        self.to_arm.room()
    }

    /// The host starts to send bytes at `now`. Returns how many were accepted.
    pub fn host_send(&mut self, now: Instant, bytes: &[u8]) -> usize {
        self.simulate(now, false);
        let accepted = if self.is_off { bytes.len() } else { self.to_arm.push(now, bytes) };
        self.record_sent(bytes.get(..accepted).unwrap_or(bytes));
        self.process(now, false);
        accepted
    }

    /// As [`Self::host_send`], for the frame of a request.
    pub fn host_request(&mut self, now: Instant, request: &Request<'_>) -> usize {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        self.host_send(now, &frame)
    }

    /// The first bytes that have arrived at the host, possibly not all of them. They fill the line until
    /// [`SimulatedArm::host_take`], and the arm holds back an answer for which the line has no room
    /// ([D5](protocol_core::decisions#d5)).
    #[must_use]
    pub fn host_received(&self) -> &[u8] {
        self.to_host.arrived()
    }

    /// Removes the first `count` of the bytes that have arrived at the host.
    pub fn host_take(&mut self, count: usize) {
        self.record_taken(count);
        self.to_host.take(count);
        // The controller may have waited for room.
        self.process(self.now, false);
    }

    /// The last host disconnects: the bytes on the line to this host are lost. The arm executes the bytes that the host sent
    /// before, without sending answers. Then this project's controller ends the reports ([M12](protocol_core::decisions#m12)).
    pub fn host_disconnect(&mut self) {
        self.record_action(self.now, Action::Disconnect);
        self.to_host.clear(self.paced_baud());
        self.leaving = Some(self.to_arm.len());
        self.end_host();
        self.process(self.now, false);
    }

    /// Tells the controller that the host has left, once all bytes of that host are executed.
    fn end_host(&mut self) {
        if self.leaving == Some(0) && !self.is_halted {
            self.controller.host_left(self.now);
            self.leaving = None;
        }
    }

    /// Simulates all events up to `now`. `host_is_idle` tells that the host has sent nothing since the last call, apart
    /// from the bytes in [`SimulatedArm::host_send`].
    pub fn advance(&mut self, now: Instant, host_is_idle: bool) {
        self.record_advance(now, host_is_idle);
        self.simulate(now, host_is_idle);
    }

    fn simulate(&mut self, now: Instant, host_is_idle: bool) {
        // With real servos only `now` is processed. At an earlier time, an answer that has arrived but was not read yet would
        // time out.
        let mut event = self.next_event();
        while !B::IS_REAL && event < now {
            self.process(event, host_is_idle);
            event = self.next_event();
        }
        self.process(now, host_is_idle);
    }

    fn process(&mut self, now: Instant, host_is_idle: bool) {
        self.now = now;
        self.to_arm.advance(now);
        self.to_host.advance(now);
        let from_servos = self.bus.poll(now);
        if !from_servos.is_empty() && !self.is_halted {
            self.controller.servo_bytes(now, from_servos);
        }
        self.end_due_faults();
        if self.is_halted {
            return;
        }
        if host_is_idle && self.to_arm.is_empty() {
            self.pass_host_bytes();
        }
        self.poll_controller();
        while !self.to_arm.arrived().is_empty() && self.pass_host_bytes() > 0 {
            self.poll_controller();
            self.end_host();
        }
    }

    /// Passes the bytes that have arrived from the host, possibly none, to the controller. Returns how many it took.
    fn pass_host_bytes(&mut self) -> usize {
        let arrived = self.to_arm.arrived();
        // The bytes of the next host wait until the bytes of the leaving host are executed.
        let end = self.leaving.unwrap_or(usize::MAX).min(arrived.len());
        let taken = self.controller.host_bytes(self.now, arrived.get(..end).unwrap_or(arrived));
        // Without bytes the tap takes the line for idle.
        let is_idle = arrived.is_empty();
        if let (Some(tap), Some(bytes)) = (self.tap.get(), arrived.get(..taken))
            && (taken > 0 || is_idle)
        {
            tap.received(self.now, bytes);
        }
        self.to_arm.take(taken);
        self.leaving = self.leaving.map(|left| left.saturating_sub(taken));
        taken
    }

    /// Executes the outputs of the controller until it waits.
    fn poll_controller(&mut self) {
        loop {
            match self.controller.poll(self.now, self.to_host.room()) {
                Output::ToHost(_) if self.leaving.is_some() => {}
                Output::ToHost(bytes) => {
                    if let Some(tap) = self.tap.get() {
                        tap.sent(self.now, bytes);
                    }
                    self.to_host.push(self.now, bytes);
                }
                Output::ToServos(bytes) => self.bus.bytes(self.now, bytes),
                Output::Vacuum(vacuum) => {
                    log_vacuum(vacuum);
                    self.suck(vacuum.pump);
                }
                Output::Save(image) => {
                    self.settings.save(&image);
                    self.controller.set_storage(self.storage());
                    settings_log::saved(&self.settings);
                }
                Output::Wait(until) => {
                    self.controller_due = until;
                    return;
                }
            }
        }
    }

    /// Sets whether the simulated pump sucks. Has no effect on real servos.
    fn suck(&mut self, is_sucking: bool) {
        self.bus.plant_mut().into_iter().for_each(|plant| plant.set_sucking(is_sucking));
    }
}

/// Starts a controller. `faults` are the initial bits of register 241.
fn start<F: NorFlash, B: ServoBus, C: ArmController>(
    now: Instant,
    arm: ArmConfig,
    settings: &Settings<F>,
    faults: u8,
    bus: &B,
) -> C {
    settings_log::opened(settings);
    let config = Config {
        chip_id: arm.chip_id,
        faults,
        servo_baud: bus.baud(),
        servo_timeout: SERVO_TIMEOUT,
        guard_time: GUARD_TIME,
        torque_codes: arm.torque_codes,
    };
    let mut controller = C::power_up(now, config, settings.found(), settings.storage());
    controller.set_answer_delay(bus.answer_delay());
    controller
}

fn log_vacuum(vacuum: Vacuum) {
    let pump = if vacuum.pump { "on" } else { "off" };
    let valve = if vacuum.valve { "open" } else { "closed" };
    info!("vacuum: pump {pump}, valve {valve}");
}
