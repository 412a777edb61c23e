//! Carries out an [`Action`].

use alloc::vec::Vec;

use embedded_storage::nor_flash::NorFlash;
use protocol_core::time::Instant;

use super::SimulatedArm;
use crate::action::Action;
use crate::controller::ArmController;
use crate::faults::FaultReport;
use crate::plant::Plant;

impl<F: NorFlash, C: ArmController> SimulatedArm<F, Plant, C> {
    /// Does something to the arm at `now`. Returns the reports of the faults that this ended.
    pub fn act(&mut self, now: Instant, action: Action) -> Vec<FaultReport> {
        match action {
            Action::Disconnect => {
                self.simulate(now, false);
                self.host_disconnect();
            }
            Action::PowerOff => self.power_off(now),
            Action::PowerCycle => self.power_cycle(now),
            Action::RestartController => self.restart_controller(now),
            Action::HaltController => self.halt_controller(now),
            Action::Fault(fault, duration) => {
                return self.set_fault(now, fault, duration).into_iter().collect();
            }
            Action::Clear(location) => return self.end_faults(now, location),
            Action::Seed(seed) => {
                self.simulate(now, false);
                self.set_seed(seed);
            }
            Action::Hand(joint, counts) => self.plant_for(now, action).move_by_hand(joint, counts),
            Action::Hold(joint) => self.plant_for(now, action).hold(joint),
            Action::LetGo(joint) => self.plant_for(now, action).let_go(joint),
            Action::Drop => return self.drop_thing(now),
            Action::Trip(joint, trip) => self.plant_for(now, action).trip(joint, trip),
            Action::Weight(grams) => self.plant_for(now, action).set_load(grams),
        }
        Vec::new()
    }

    fn plant_for(&mut self, now: Instant, action: Action) -> &mut Plant {
        self.record_action(now, action);
        self.simulate(now, false);
        self.plant_mut()
    }
}
