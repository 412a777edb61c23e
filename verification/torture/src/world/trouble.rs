//! What goes wrong next.

use arm_sim::servo::Fault;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{FrameBuffer, register, sync_write};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::power::Power;
use super::servos::Disturbance;
use super::{Life, World};
use crate::scenario::Trouble;

/// Between two small turns of a hand.
const HAND_EVERY: Duration = Duration::from_millis(10);
/// The fastest that a hand turns a joint, in thousandths of a count in that time: about 25 degrees/s.
const FASTEST_HAND: usize = 1_000;

/// How long the controller hangs until its watchdog acts, at least and at most.
const WATCHDOG: [Duration; 2] = [Duration::from_millis(1_000), Duration::from_millis(2_000)];
/// Between two frames of the fault path, so that the bus is silent before each.
const FAULT_PAUSE: Duration = Duration::from_millis(3);

/// A hand that turns a joint.
#[derive(Debug)]
pub(super) struct Hand {
    joint: Joint,
    /// In thousandths of a count.
    place: i64,
    step: i64,
    until: Instant,
    next_at: Instant,
}

impl Hand {
    pub(super) const fn next_at(&self) -> Instant {
        self.next_at
    }
}

/// From a millisecond to five seconds.
fn some_time(world: &mut World) -> Duration {
    world.dice.any_scale(Duration::from_millis(1), Duration::from_millis(5_000))
}

impl World {
    pub(super) fn trouble(&mut self) {
        self.trouble_at = self.now + self.dice.wait(self.scenario.every);
        let Some(&trouble) = self.scenario.troubles.get(self.dice.below(self.scenario.troubles.len())) else {
            return;
        };
        self.notes.event(self.now, format!("{trouble:?}"));
        match trouble {
            Trouble::Servo => self.servo_trouble(),
            Trouble::Reset => {
                self.tally.servo_faults += 1;
                let joint = self.dice.joint();
                self.servos.reset(self.now, joint);
            }
            Trouble::Bus => self.bus_trouble(),
            Trouble::Echo => {
                let has_echo = self.dice.one_in(3);
                self.servos.set_echo(has_echo);
            }
            Trouble::Line => self.client.damaged = self.dice.one_of(&[0, 0, 20_000, 100_000, 400_000], 0),
            Trouble::Stall => self.stall(),
            Trouble::Hand => self.lend_hand(),
            Trouble::Wear => self.wear(),
            Trouble::Deaf
            | Trouble::Cut
            | Trouble::Restart
            | Trouble::Watchdog
            | Trouble::Fault
            | Trouble::SaveCut => self.life_trouble(trouble),
        }
    }

    fn servo_trouble(&mut self) {
        self.tally.servo_faults += 1;
        let joint = self.dice.joint();
        let fault = match self.dice.below(10) {
            0..=3 => None,
            4 | 5 => Some(Fault::Missing),
            6 => {
                Some(Fault::Late(self.dice.any_scale(Duration::from_micros(100), Duration::from_millis(150))))
            }
            7 => Some(Fault::Garbled(1)),
            8 => Some(Fault::Garbled(2 + u32::from(self.dice.up_to(20)))),
            _ => Some(Fault::Stuck),
        };
        self.notes.event(self.now, format!("servo {}: {fault:?}", joint.number()));
        self.servos.set_fault(self.now, joint, fault);
    }

    fn bus_trouble(&mut self) {
        let damaged = self.dice.one_of(&[0, 0, 100, 10_000, 100_000, 500_000], 0);
        let late = self.dice.one_of(&[0, 0, 100, 10_000, 100_000], 0);
        self.notes.event(self.now, format!("of a million: {damaged} damaged, {late} late"));
        self.servos.set_disturbance(self.now, Disturbance { damaged, late });
    }

    fn stall(&mut self) {
        let time = some_time(self);
        self.tally.stalls += 1;
        self.stalled_until = self.now + time;
        if let Power::On(life) = &mut self.power {
            life.audit.shell_was_late(self.stalled_until, time);
        }
    }

    fn wear(&mut self) {
        let (sector, bit) = (self.dice.below(2), self.dice.any());
        // Seldom a sector: after both, nothing is left to try.
        if self.dice.one_in(40) {
            self.settings.wear_out_sector(sector);
        } else if self.dice.one_in(4) {
            self.settings.wear_out_bit(bit);
        }
    }

    fn life_trouble(&mut self, trouble: Trouble) {
        let deaf_until = self.now + some_time(self);
        let Power::On(mut life) = std::mem::replace(&mut self.power, Power::None) else {
            return self.no_trouble();
        };
        match trouble {
            Trouble::Deaf => life.to_host.block(deaf_until),
            Trouble::SaveCut => life.save_is_cut = true,
            Trouble::Watchdog => return self.hang(&life),
            Trouble::Fault => return self.fault(&life),
            _ => return self.power_down(&life, trouble == Trouble::Cut),
        }
        self.power = Power::On(life);
    }

    /// The controller hangs until its watchdog restarts it. From outside, that is a long restart.
    fn hang(&mut self, life: &Life) {
        self.power_down(life, false);
        let time = self.dice.between(WATCHDOG[0], WATCHDOG[1]);
        self.power = Power::Off { until: self.now + time, servos_too: false };
    }

    /// The controller panics: it damps all servos three times and starts again.
    fn fault(&mut self, life: &Life) {
        self.power_down(life, false);
        let mut frame = FrameBuffer::new();
        let code = self.servos.torque_codes().code(Torque::Damping);
        let items = Joint::ALL.into_iter().map(|joint| (joint.index(), [code]));
        sync_write(&mut frame, register::TORQUE_SWITCH, items);
        for _ in 0..3 {
            self.now = self.now + FAULT_PAUSE;
            self.notes.bus(self.now, "to servos, by the fault path", &frame);
            self.servos.controller_fails(self.now, &frame);
        }
    }

    /// The power is off already, which is trouble enough.
    fn no_trouble(&mut self) {
        self.power = Power::Off { until: self.now, servos_too: true };
    }

    fn lend_hand(&mut self) {
        let joint = self.dice.joint();
        self.hand.take().into_iter().for_each(|hand| self.servos.let_go(hand.joint));
        let speed = i64::try_from(self.dice.below(2 * FASTEST_HAND + 1)).unwrap_or(0);
        self.hand = Some(Hand {
            joint,
            place: i64::from(self.servos.position(joint)) * 1_000,
            step: speed - i64::try_from(FASTEST_HAND).unwrap_or(0),
            until: self.now + some_time(self),
            next_at: self.now,
        });
    }

    /// A hand is no match for a motor: it lets go of a joint that is driven, or may be. A silent joint may be.
    pub(super) fn move_hand(&mut self) {
        let Some(hand) = self.hand.as_mut().filter(|hand| hand.next_at <= self.now) else { return };
        let is_driven = match &self.power {
            Power::On(life) => life.model.is_servo() && !Self::is_missing(life, hand.joint),
            _ => true,
        };
        let is_driven = is_driven || self.servos.has_torque(hand.joint);
        if is_driven || self.now > hand.until || !self.servos.wire_is_quiet(self.now) {
            self.servos.let_go(hand.joint);
            self.hand = None;
            return;
        }
        hand.place = (hand.place + hand.step).clamp(0, 1_023_000);
        hand.next_at = self.now + HAND_EVERY;
        let (joint, counts) = (hand.joint, u16::try_from(hand.place / 1_000).unwrap_or(0));
        self.servos.turn(self.now, joint, counts);
    }
}
