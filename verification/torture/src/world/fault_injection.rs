//! Injects the faults of the scenario, one at a time.

use arm_sim::servo::ServoFault;
use protocol_core::registers::map::MISSING_SERVOS;
use protocol_core::time::Duration;

use super::disturbed_bus::DisturbanceRates;
use super::state::{Hand, PowerState, PoweredArm, TortureWorld};
use crate::panic_handler::{FRAMES, damping_frame};
use crate::scenario::InjectedFault;

/// The time between two steps of a hand.
const HAND_PERIOD: Duration = Duration::from_millis(10);
/// The largest step of a hand, in thousandths of a count. One count per [`HAND_PERIOD`] is 21 to 29 degrees/s.
const MAX_HAND_STEP: usize = 1_000;
/// The shortest and the longest time from a hang until the watchdog restarts the controller.
const WATCHDOG_TIME: [Duration; 2] = [Duration::from_millis(1_000), Duration::from_millis(2_000)];
/// The pause before each frame of the panic handler.
const PANIC_PAUSE: Duration = Duration::from_millis(3);

impl TortureWorld {
    pub(super) fn inject_fault(&mut self) {
        self.next_fault_at = self.now + self.rng.wait(self.scenario.mean_interval);
        let Some(&fault) = self.scenario.faults.get(self.rng.below(self.scenario.faults.len())) else {
            return;
        };
        self.log.event(self.now, format!("{fault:?}"));
        self.supply_rule.forget();
        match fault {
            InjectedFault::ServoFault => self.change_servo_fault(),
            InjectedFault::ServoRestart => {
                self.counts.servo_faults += 1;
                let joint = self.rng.joint();
                self.bus.restart_servo(self.now, joint);
            }
            InjectedFault::BusDisturbance => self.change_bus_disturbance(),
            InjectedFault::BusEcho => {
                let has_echo = self.rng.one_in(3);
                self.bus.set_echo(has_echo);
            }
            InjectedFault::HostLinkCorruption => {
                self.generator.corrupted_per_million = self.rng.one_of(&[0, 0, 20_000, 100_000, 400_000], 0);
            }
            InjectedFault::ShellStall => self.stall_shell(),
            InjectedFault::Hand => self.start_hand(),
            InjectedFault::FlashWear => self.wear_flash(),
            InjectedFault::Wall
            | InjectedFault::Push
            | InjectedFault::Thing
            | InjectedFault::Payload
            | InjectedFault::ServoTrip
            | InjectedFault::EmergencyStop => self.inject_outside(fault),
            InjectedFault::HostStopsReading
            | InjectedFault::PowerCut
            | InjectedFault::Restart
            | InjectedFault::Watchdog
            | InjectedFault::Panic
            | InjectedFault::PowerCutInSave => self.inject_controller_fault(fault),
        }
    }

    /// A random time from a millisecond to five seconds.
    fn random_time(&mut self) -> Duration {
        self.rng.any_scale(Duration::from_millis(1), Duration::from_millis(5_000))
    }

    fn change_servo_fault(&mut self) {
        self.counts.servo_faults += 1;
        let joint = self.rng.joint();
        let fault = match self.rng.below(10) {
            0..=3 => None,
            4 | 5 => Some(ServoFault::Missing),
            6 => Some(ServoFault::Late(
                self.rng.any_scale(Duration::from_micros(100), Duration::from_millis(150)),
            )),
            7 => Some(ServoFault::Garbled(1)),
            8 => Some(ServoFault::Garbled(2 + u32::from(self.rng.up_to(20)))),
            _ => Some(ServoFault::Stuck),
        };
        self.log.event(self.now, format!("servo {}: {fault:?}", joint.number()));
        self.bus.set_fault(self.now, joint, fault);
    }

    fn change_bus_disturbance(&mut self) {
        let corrupted = self.rng.one_of(&[0, 0, 100, 10_000, 100_000, 500_000], 0);
        let delayed = self.rng.one_of(&[0, 0, 100, 10_000, 100_000], 0);
        self.log.event(self.now, format!("frames per million: {corrupted} corrupted, {delayed} delayed"));
        self.bus.set_disturbance(self.now, DisturbanceRates { corrupted, delayed });
    }

    fn stall_shell(&mut self) {
        let time = self.random_time();
        self.counts.stalls += 1;
        self.stalled_until = self.now + time;
        if let PowerState::On(arm) = &mut self.power {
            arm.status_checker.shell_was_late(self.stalled_until, time);
        }
    }

    fn wear_flash(&mut self) {
        let (sector, bit) = (self.rng.below(2), self.rng.any());
        // Sectors rarely wear out: once both are worn, the storage is broken for the rest of the world.
        if self.rng.one_in(40) {
            self.storage.wear_out_sector(sector);
        } else if self.rng.one_in(4) {
            self.storage.wear_out_bit(bit);
        }
    }

    /// Injects a fault that only a powered controller can have. If the controller is off, switches it on instead.
    fn inject_controller_fault(&mut self, fault: InjectedFault) {
        let blocked_until = self.now + self.random_time();
        let PowerState::On(mut arm) = std::mem::replace(&mut self.power, PowerState::Taken) else {
            self.power = PowerState::Off { until: self.now, servos_too: true };
            return;
        };
        match fault {
            InjectedFault::HostStopsReading => arm.to_host.block(blocked_until),
            InjectedFault::PowerCutInSave => arm.cuts_next_save = true,
            InjectedFault::Watchdog => return self.hang(&arm),
            InjectedFault::Panic => return self.panic(&arm),
            _ => return self.power_down(&arm, fault == InjectedFault::PowerCut),
        }
        self.power = PowerState::On(arm);
    }

    /// The controller hangs until its watchdog restarts it. Outside the controller, this is a long restart.
    fn hang(&mut self, arm: &PoweredArm) {
        self.power_down(arm, false);
        let time = self.rng.between(WATCHDOG_TIME[0], WATCHDOG_TIME[1]);
        self.power = PowerState::Off { until: self.now + time, servos_too: false };
    }

    /// The controller panics: its panic handler sends its frames to all servos and restarts.
    fn panic(&mut self, arm: &PoweredArm) {
        self.power_down(arm, false);
        let frame = damping_frame(self.bus.torque_codes());
        for _ in 0..FRAMES {
            self.now = self.now + PANIC_PAUSE;
            self.log.bus(self.now, "to servos, by the panic handler", &frame);
            self.bus.send_panic_frame(self.now, &frame);
        }
    }

    fn start_hand(&mut self) {
        let joint = self.rng.joint();
        self.hand.take().into_iter().for_each(|hand| self.bus.release_by_hand(hand.joint));
        let speed = i64::try_from(self.rng.below(2 * MAX_HAND_STEP + 1)).unwrap_or(0);
        self.hand = Some(Hand {
            joint,
            millicounts: i64::from(self.bus.position(joint)) * 1_000,
            step: speed - i64::try_from(MAX_HAND_STEP).unwrap_or(0),
            until: self.now + self.random_time(),
            next_at: self.now,
        });
    }

    /// Moves the hand. The hand releases the joint if the joint may be driven, if the time of the hand is over, or if the bus is
    /// disturbed. A joint whose servo is reported as missing counts as driven only while its servo has torque.
    pub(super) fn move_hand(&mut self) {
        let Some(hand) = self.hand.as_mut().filter(|hand| hand.next_at <= self.now) else { return };
        let is_driven = match &self.power {
            PowerState::On(arm) => {
                let missing = arm.controller.registers().get(MISSING_SERVOS.address);
                arm.model.is_servo() && missing & hand.joint.bit() == 0
            }
            _ => true,
        };
        let is_driven = is_driven || self.bus.has_torque(hand.joint);
        if is_driven || self.now > hand.until || !self.bus.is_undisturbed(self.now) {
            self.bus.release_by_hand(hand.joint);
            self.hand = None;
            return;
        }
        hand.millicounts = (hand.millicounts + hand.step).clamp(0, 1_023_000);
        hand.next_at = self.now + HAND_PERIOD;
        let (joint, counts) = (hand.joint, u16::try_from(hand.millicounts / 1_000).unwrap_or(0));
        self.bus.turn_by_hand(self.now, joint, counts);
    }
}
