//! Power-up and power-down of the controller.

use std::collections::VecDeque;

use flash_model::{Cut, EraseTear, ProgramTear};
use motion_core::{Config, Controller};
use protocol_core::registers::map::baud_rate;
use protocol_core::time::Duration;

use super::command_checker::CommandChecker;
use super::host_link::{ArmToHost, HostToArm};
use super::let_go_rule::LetGoRule;
use super::register_model::RegisterModel;
use super::settings_storage::{PowerOutcome, StoredSettings};
use super::state::{PowerState, PoweredArm, TortureWorld};
use super::status_checker::StatusChecker;
use super::watchdog_model::WatchdogModel;
use crate::seeded_rng::SeededRng;
use crate::violation::{Check, ensure};

/// The chip id of every simulated arm.
const CHIP_ID: [u8; 6] = [1, 2, 3, 4, 5, 6];
/// The pause of the reference board between two frames on the servo bus.
const GUARD_TIME: Duration = Duration::from_micros(100);

/// A random power cut at one of the next `operations` of the flash.
pub(super) fn random_cut(operations: usize, rng: &mut SeededRng) -> Cut {
    Cut {
        after: rng.below(operations),
        program: rng.one_of(&ProgramTear::ALL, ProgramTear::All),
        erase: rng.one_of(&EraseTear::ALL, EraseTear::All),
        seed: rng.any(),
    }
}

impl TortureWorld {
    pub(super) fn power_up(&mut self, servos_too: bool) -> Check {
        if servos_too {
            self.bus.power_cycle(self.now);
        }
        let is_cut = self.rng.below(100) < usize::try_from(self.scenario.cut_starts_percent).unwrap_or(0);
        let cut = is_cut.then(|| random_cut(20, &mut self.rng));
        match self.storage.start(self.rng.any(), cut)? {
            PowerOutcome::Completed(stored) => self.start_controller(stored),
            PowerOutcome::Cut => {
                self.counts.power_cuts += 1;
                self.counts.cut_starts += 1;
                self.log.event(self.now, "power cut during start".to_owned());
                self.power = self.off(true);
                Ok(())
            }
        }
    }

    fn start_controller(&mut self, stored: StoredSettings) -> Check {
        let now = self.now;
        let config = Config {
            chip_id: CHIP_ID,
            faults: 0,
            servo_baud: 1_000_000,
            servo_timeout: self.parameters.servo_timeout,
            guard_time: GUARD_TIME,
            torque_codes: self.parameters.torque_codes,
        };
        self.log.event(now, format!("power on, {stored:?}"));
        let controller = Controller::new(now, config, stored.image.as_ref(), stored.storage);
        let model = RegisterModel::new(CHIP_ID, stored.image.as_ref(), stored.storage);
        model.compare(controller.registers())?;
        let baud = controller.baud();
        ensure(baud == baud_rate(model.baud_code()), || format!("the controller starts with {baud} baud"))?;
        self.generator.reset(now);
        self.stalled_until = now;
        let (codes, timeout) = (self.bus.torque_codes(), self.parameters.servo_timeout);
        self.power = PowerState::On(Box::new(PoweredArm {
            controller,
            output_bytes: Vec::new(),
            owed: None,
            model,
            watchdog: WatchdogModel::OFF,
            command_checker: CommandChecker::new(now, codes, timeout),
            status_checker: StatusChecker::new(now),
            let_go_rule: LetGoRule::NONE,
            to_arm: HostToArm::new(baud),
            to_host: ArmToHost::new(baud, now),
            pending: VecDeque::new(),
            wake_at: now,
            cuts_next_save: false,
            expired_waits: 0,
        }));
        Ok(())
    }

    /// Ends the controller by a power cut or a restart, and drops the requests that it has not executed. The controller starts
    /// again after a random time.
    pub(super) fn power_down(&mut self, arm: &PoweredArm, servos_too: bool) {
        self.supply_rule.forget();
        self.counts.power_cuts += 1;
        self.counts += arm.command_checker.counts();
        if !servos_too {
            self.bus.restarted_at = self.now;
        }
        let event = if servos_too { "power cut" } else { "restart" };
        self.log.event(self.now, format!("{event}, {} pending requests", arm.pending.len()));
        self.power = self.off(servos_too);
    }

    fn off(&mut self, servos_too: bool) -> PowerState {
        let time = self.rng.any_scale(Duration::from_micros(100), Duration::from_millis(3_000));
        PowerState::Off { until: self.now + time, servos_too }
    }
}
