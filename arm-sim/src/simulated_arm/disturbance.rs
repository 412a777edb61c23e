//! Faults of a running arm, each until it is removed or its time is over. Also the seed and the deadlines of the host line, and
//! the release of everything that the tool holds.

use alloc::vec::Vec;

use embedded_storage::nor_flash::NorFlash;
use protocol_core::settings::Storage;
use protocol_core::time::{Duration, Instant};

use super::SimulatedArm;
use crate::action::Action;
use crate::controller::ArmController;
use crate::fault_count::FaultCount;
use crate::faults::list::ListedFault;
use crate::faults::{ArmFault, FaultLocation, FaultReport};
use crate::faulty_flash::FlashFault;
use crate::host_line::LineDirection;
use crate::plant::Plant;
use crate::servo_bus::ServoBus;

impl<F: NorFlash, C: ArmController> SimulatedArm<F, Plant, C> {
    /// The controller, for example to read its registers.
    #[must_use]
    pub const fn controller(&self) -> &C {
        &self.controller
    }

    /// Sets the seed of the random faults of the host line, 1 by default. The bytes on the host line are lost, and the counts of
    /// its faults begin again at 0.
    pub fn set_seed(&mut self, seed: u64) {
        self.record_action(self.now, Action::Seed(seed));
        (self.to_arm, self.to_host) = LineDirection::pair(seed);
        self.clear_host_line();
        for ListedFault { fault, .. } in self.faults.iter() {
            if let ArmFault::Line(fault) = fault {
                self.to_arm.set_fault(fault);
                self.to_host.set_fault(fault);
            }
        }
    }

    /// Gives each byte on the host line its own deadline. Then results do not depend on whether the host sends two frames at
    /// once, or the second one as soon as the first one has arrived. [`SimulatedArm::set_seed`] resets this.
    pub const fn set_bytewise_line(&mut self) {
        self.to_arm.set_bytewise();
        self.to_host.set_bytewise();
    }

    /// Adds a fault at `now`, for `duration` or until it is removed. Returns the report of the fault that it replaces.
    pub fn set_fault(
        &mut self,
        now: Instant,
        fault: ArmFault,
        duration: Option<Duration>,
    ) -> Option<FaultReport> {
        self.record_action(now, Action::Fault(fault, duration));
        self.simulate(now, false);
        let replaced = self.faults.take_replaced(fault).map(|replaced| self.end(replaced));
        self.faults.add(fault, duration.map(|duration| now + duration));
        fault.apply(&mut self.bus);
        match fault {
            ArmFault::Flash(FlashFault::Fails) => self.settings.flash_mut().set_fails(true),
            ArmFault::Flash(FlashFault::Full) => self.controller.set_storage(Storage::Full),
            ArmFault::Line(fault) => {
                self.to_arm.set_fault(fault);
                self.to_host.set_fault(fault);
            }
            _ => {}
        }
        self.process(now, false);
        replaced
    }

    /// Removes the faults at a location at `now`, or all faults with `None`. Returns their reports.
    pub fn end_faults(&mut self, now: Instant, location: Option<FaultLocation>) -> Vec<FaultReport> {
        self.record_action(now, Action::Clear(location));
        self.simulate(now, false);
        let ended = self.faults.take_at(location).into_iter().map(|listed| self.end(listed)).collect();
        self.process(now, false);
        ended
    }

    /// Drops everything that the tool holds at `now`. Returns the report of the thing between the claws, if there was one.
    pub(super) fn drop_thing(&mut self, now: Instant) -> Vec<FaultReport> {
        self.record_action(now, Action::Drop);
        self.simulate(now, false);
        let things = self.faults.take_things();
        let ended = things.into_iter().map(|listed| self.end(listed)).collect();
        self.bus.drop_thing();
        ended
    }

    /// The faults of the arm, and how often they took effect so far.
    pub fn faults(&mut self) -> Vec<FaultReport> {
        let listed: Vec<ListedFault> = self.faults.iter().collect();
        listed.into_iter().map(|listed| self.report(listed)).collect()
    }

    /// Takes the reports of the faults that have ended by themselves since the last call; of more than 16, the last 16.
    pub fn take_ended_faults(&mut self) -> Vec<FaultReport> {
        self.ended_faults.take()
    }

    /// Is a byte of the host on the way to the controller, or one of the controller on the way to the host? Bytes that wait for a
    /// halted controller, or for room on the line to the host, do not count.
    #[must_use]
    pub fn is_host_line_busy(&self) -> bool {
        let waits = !self.is_halted && !self.to_arm.arrived().is_empty() && self.to_host.room() > 0;
        waits || self.to_arm.is_in_transit() || self.to_host.is_in_transit()
    }
}

impl<F: NorFlash, B: ServoBus, C: ArmController> SimulatedArm<F, B, C> {
    /// Ends the faults whose time is over, and the fault of a thing that the claws have dropped. Keeps their reports.
    pub(super) fn end_due_faults(&mut self) {
        if self.faults.has_thing() && self.bus.plant_mut().is_some_and(|plant| !plant.has_thing()) {
            // The claws opened and dropped the thing.
            for listed in self.faults.take_things() {
                let report = self.end(listed);
                self.ended_faults.push(report);
            }
        }
        if self.faults.deadline().is_none_or(|deadline| deadline > self.now) {
            return;
        }
        for listed in self.faults.take_due(self.now) {
            let report = self.end(listed);
            self.ended_faults.push(report);
        }
    }

    /// The state of the settings storage, with [`FlashFault::Full`] applied.
    pub(super) fn storage(&self) -> Storage {
        let is_full = self.faults.contains(ArmFault::Flash(FlashFault::Full));
        if is_full { Storage::Full } else { self.settings.storage() }
    }

    fn end(&mut self, listed: ListedFault) -> FaultReport {
        let report = self.report(listed);
        self.bus.plant_mut().into_iter().for_each(|plant| listed.fault.remove(plant));
        match listed.fault {
            ArmFault::Flash(FlashFault::Fails) => self.settings.flash_mut().set_fails(false),
            ArmFault::Flash(FlashFault::Full) => self.controller.set_storage(self.settings.storage()),
            ArmFault::Line(fault) => {
                self.to_arm.end_fault(fault);
                self.to_host.end_fault(fault);
            }
            _ => {}
        }
        report
    }

    fn report(&mut self, ListedFault { fault, until }: ListedFault) -> FaultReport {
        FaultReport { fault, until, count: self.fault_count(fault) }
    }

    fn fault_count(&mut self, fault: ArmFault) -> Option<FaultCount> {
        match fault {
            ArmFault::Servo(joint, _) => Some(self.bus.plant_mut()?.fault_count(joint)),
            ArmFault::Obstacle(joint, obstacle) => Some(obstacle.count(joint, self.bus.plant_mut()?)),
            ArmFault::Echo => Some(self.bus.plant_mut()?.echo_count()),
            ArmFault::Supply(_) => Some(self.bus.plant_mut()?.supply_fault_count()),
            ArmFault::Flash(FlashFault::Fails) => Some(self.settings.flash_mut().count()),
            ArmFault::Line(fault) => {
                Some(self.to_arm.fault_count(fault).plus(self.to_host.fault_count(fault)))
            }
            ArmFault::Flash(FlashFault::Full) | ArmFault::Supported | ArmFault::GoalStartsTorque => None,
        }
    }
}
