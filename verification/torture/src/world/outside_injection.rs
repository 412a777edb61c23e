//! Injects influences from outside the arm: obstacles, payloads, forced alarms and emergency stops.

use arm_sim::plant::{Thing, Wall};
use arm_sim::servo::Trip;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use super::outside_ending::Ending;
use super::state::{PowerState, TortureWorld};
use crate::scenario::InjectedFault;

/// The longest time of a wall, a push or a thing.
const LONGEST: Duration = Duration::from_millis(60_000);
/// The shortest time of a wall, a push or a thing.
const SHORTEST: Duration = Duration::from_millis(50);
/// The times of emergency stops, in milliseconds.
const STOPS: [u64; 3] = [300, 3_000, 30_000];
/// After an emergency stop, no other fault begins for this time, apart from repeated overloads.
const AFTER_STOP: Duration = Duration::from_millis(3_000);
/// The number of repeated overloads of a servo, and the time between two of them. A joint that fell comes to rest and
/// engages within this time.
const TRIPS: u8 = 5;
const TRIP_PERIOD: Duration = Duration::from_millis(6_000);
/// A wall or a thing is at most this far from the joint, in millidegrees.
const FARTHEST_WALL: i32 = 40_000;
/// The strongest push on joints 1 to 4 and on joints 5 to 7, in millinewton metres: below the stall torque of their
/// servos. A stronger push turns a joint so fast that the controller rejects its readings (D12).
const STRONGEST_PUSH: [usize; 2] = [1_500, 250];
/// The heaviest payload in grams.
const HEAVIEST: usize = 500;

impl TortureWorld {
    /// Injects one of the faults of this file.
    pub(super) fn inject_outside(&mut self, fault: InjectedFault) {
        match fault {
            InjectedFault::ServoTrip => self.trip_servo(),
            InjectedFault::EmergencyStop => self.stop(),
            _ => {
                self.counts.obstacles += 1;
                self.put_obstacle(fault);
            }
        }
    }

    fn put_obstacle(&mut self, fault: InjectedFault) {
        let joint = self.rng.joint();
        match fault {
            InjectedFault::Payload => {
                let grams = if self.rng.one_in(3) { 0 } else { self.rng.below(HEAVIEST + 1) };
                self.log.event(self.now, format!("{grams} g"));
                self.bus.set_load(self.now, u16::try_from(grams).unwrap_or(0));
            }
            InjectedFault::Thing => {
                let [.., claw] = Joint::ALL;
                let (millidegrees, stiffness) = (self.place(claw), self.stiffness());
                // The claws close towards smaller angles, and must not be inside the thing yet.
                if millidegrees < self.bus.angle(claw) {
                    let thing = Thing { millidegrees, stiffness };
                    self.log.event(self.now, format!("{thing:?}"));
                    self.bus.set_thing(self.now, Some(thing));
                    self.end_later(Ending::Thing);
                }
            }
            InjectedFault::Push => {
                let [large, small] = STRONGEST_PUSH;
                let strongest = if joint.number() < 5 { large } else { small };
                let torque = i16::try_from(self.rng.below(2 * strongest + 1)).unwrap_or(0);
                let torque = torque - i16::try_from(strongest).unwrap_or(0);
                self.log.event(self.now, format!("push of joint {} with {torque} mN m", joint.number()));
                self.bus.push(self.now, joint, torque);
                self.end_later(Ending::Push(joint));
            }
            _ => {
                let wall = Wall { millidegrees: self.place(joint), stiffness: self.stiffness() };
                self.log.event(self.now, format!("joint {}: {wall:?}", joint.number()));
                self.bus.set_wall(self.now, joint, Some(wall));
                self.end_later(Ending::Wall(joint));
            }
        }
    }

    /// A random angle near the angle of a joint, in millidegrees.
    fn place(&mut self, joint: Joint) -> i32 {
        let span = usize::try_from(2 * FARTHEST_WALL).unwrap_or(0);
        let distance = i32::try_from(self.rng.below(span)).unwrap_or(0) - FARTHEST_WALL;
        (self.bus.angle(joint) + distance).clamp(0, 180_000)
    }

    /// `None` for a stiff obstacle, or 10 to 1000 mN m per degree.
    fn stiffness(&mut self) -> Option<u16> {
        let soft = u16::try_from(10 + self.rng.below(991)).unwrap_or(10);
        if self.rng.one_in(2) { None } else { Some(soft) }
    }

    fn end_later(&mut self, ending: Ending) {
        let until = self.now + self.rng.any_scale(SHORTEST, LONGEST);
        self.endings.retain(|(_, other)| *other != ending);
        self.endings.push((until, ending));
    }

    /// Carries out the endings that are due.
    pub(super) fn end_outside(&mut self) {
        while let Some(index) = self.endings.iter().position(|(at, _)| *at <= self.now) {
            let (_, ending) = self.endings.swap_remove(index);
            let what = if let Ending::Trip(_) = ending { "once more" } else { "end of" };
            self.log.event(self.now, format!("{what} {ending:?}"));
            match ending {
                Ending::Wall(joint) => self.bus.set_wall(self.now, joint, None),
                Ending::Push(joint) => self.bus.push(self.now, joint, 0),
                Ending::Thing => self.bus.set_thing(self.now, None),
                Ending::Trip(joint) => self.bus.trip(self.now, joint, Trip::Overload),
                Ending::Stop => {
                    self.bus.end_stop(self.now);
                    self.supply_rule.stop_ends(self.now);
                }
            }
        }
    }

    /// The time of the next ending.
    pub(super) fn next_ending(&self) -> Instant {
        self.endings.iter().map(|(at, _)| *at).min().unwrap_or(Instant::FAR_FUTURE)
    }

    fn trip_servo(&mut self) {
        self.counts.servo_trips += 1;
        let joint = self.rng.joint();
        let trip = if self.rng.one_in(2) { Trip::Overload } else { Trip::Heat };
        self.log.event(self.now, format!("servo {}: {trip:?}", joint.number()));
        self.bus.trip(self.now, joint, trip);
        if self.rng.one_in(4) {
            self.trip_again_and_again(joint);
        }
    }

    /// Forces [`TRIPS`] more overloads on a servo, so that its joint may no longer engage (D28). The host only reads meanwhile.
    fn trip_again_and_again(&mut self, joint: Joint) {
        let mut at = self.now;
        for _ in 0..TRIPS {
            at = at + TRIP_PERIOD;
            self.endings.push((at, Ending::Trip(joint)));
        }
        self.generator.only_read_until(at + TRIP_PERIOD);
    }

    /// Cuts the supply of the servos for one of the times in [`STOPS`], and delays the next fault until after the stop.
    fn stop(&mut self) {
        let millis = self.rng.one_of(&STOPS, 300);
        let until = self.now + Duration::from_millis(millis);
        self.counts.emergency_stops += 1;
        self.log.event(self.now, format!("the supply is off for {millis} ms"));
        let is_driven = match &self.power {
            PowerState::On(arm) => arm.model.is_servo() && self.bus.all_hold(self.now),
            _ => false,
        };
        self.bus.begin_stop(self.now);
        if is_driven {
            self.supply_rule.stop_begins(self.now);
        }
        self.endings.retain(|(_, other)| *other != Ending::Stop);
        self.endings.push((until, Ending::Stop));
        self.next_fault_at = self.next_fault_at.max(until + AFTER_STOP);
    }
}
