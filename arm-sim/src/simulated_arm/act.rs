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
    /// Carries out an action at `now`. Returns the reports of the faults that it ended.
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
            Action::Drop => return self.drop_thing(now),
            Action::Hand(..)
            | Action::Hold(_)
            | Action::LetGo(_)
            | Action::Trip(..)
            | Action::Weight(_)
            | Action::Scene(_) => {
                self.record_action(now, action.clone());
                self.simulate(now, false);
                act_on_plant(self.plant_mut(), action);
            }
        }
        Vec::new()
    }
}

/// Carries out the actions that change nothing but the plant. [`SimulatedArm::act`] handles all others.
fn act_on_plant(plant: &mut Plant, action: Action) {
    match action {
        Action::Hand(joint, counts) => plant.move_by_hand(joint, counts),
        Action::Hold(joint) => plant.hold(joint),
        Action::LetGo(joint) => plant.let_go(joint),
        Action::Trip(joint, trip) => plant.trip(joint, trip),
        Action::Weight(grams) => plant.set_load(grams),
        Action::Scene(scene) => plant.set_scene(scene),
        _ => {}
    }
}
