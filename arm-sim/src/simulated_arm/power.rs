//! The power of an arm, and the start and the end of its controller.

use embedded_storage::nor_flash::NorFlash;
use protocol_core::registers::map::fault;
use protocol_core::time::Instant;

use super::{SimulatedArm, start};
use crate::action::Action;
use crate::controller::ArmController;
use crate::plant::Plant;
use crate::servo_bus::ServoBus;

impl<F: NorFlash, C: ArmController> SimulatedArm<F, Plant, C> {
    /// Switches the arm off at `now`, until [`SimulatedArm::power_cycle`]. RAM and the bytes on the host line are lost, and so
    /// are the bytes that the host sends meanwhile. Loaded joints fall.
    pub fn power_off(&mut self, now: Instant) {
        self.record_action(now, Action::PowerOff);
        self.halt(now);
        self.is_off = true;
        self.bus.power_off(now);
        self.clear_host_line();
    }

    /// Is the arm on? False from [`SimulatedArm::power_off`] until [`SimulatedArm::power_cycle`].
    #[must_use]
    pub const fn has_power(&self) -> bool {
        !self.is_off
    }

    /// Does the controller hang, after [`SimulatedArm::halt_controller`]?
    #[must_use]
    pub const fn is_halted(&self) -> bool {
        self.is_halted && !self.is_off
    }
}

impl<F: NorFlash, B: ServoBus, C: ArmController> SimulatedArm<F, B, C> {
    /// Switches the arm off and on at `now`. RAM and the bytes on the host line are lost; the flash stays.
    pub fn power_cycle(&mut self, now: Instant) {
        self.record_action(now, Action::PowerCycle);
        self.simulate(now, false);
        self.bus.power_cycle(now);
        self.start_controller(now, 0);
    }

    /// Restarts only the controller at `now`, as its watchdog does. RAM and the bytes on the host line are lost. The
    /// servos keep power, torque and goals. Has no effect while the arm is off.
    pub fn restart_controller(&mut self, now: Instant) {
        self.record_action(now, Action::RestartController);
        self.simulate(now, false);
        // Without power the controller does not start.
        if !self.is_off {
            self.start_controller(now, fault::WATCHDOG_RESTART);
        }
    }

    /// Stops the controller at `now`, as if its program hung. It sends and receives nothing until
    /// [`SimulatedArm::restart_controller`] or [`SimulatedArm::power_cycle`]. The servos keep their goals.
    pub fn halt_controller(&mut self, now: Instant) {
        self.record_action(now, Action::HaltController);
        self.halt(now);
    }

    fn halt(&mut self, now: Instant) {
        self.simulate(now, false);
        self.is_halted = true;
        self.controller_due = Instant::FAR_FUTURE;
    }

    fn start_controller(&mut self, now: Instant, faults: u8) {
        self.settings.reopen();
        self.controller = start(now, self.config, &self.settings, faults, &self.bus);
        self.controller_due = now;
        self.suck(false);
        self.controller.set_storage(self.storage());
        self.is_halted = false;
        self.is_off = false;
        self.leaving = None;
        self.start_host_line();
        self.process(now, false);
    }
}
