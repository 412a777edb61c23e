//! Random actions of a host, and of a person who handles the arm, drawn from a seed.

use std::fmt::Write;
use std::sync::{Arc, Mutex, PoisonError};

use arm_sim::request::Request;
use arm_sim::session::{Entry, SessionHeader, SessionRecorder};
use arm_sim::{Action, Duration, Joint, Simulation};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// The number of actions in a session.
const ACTS: u32 = 40;
/// The longest time between two actions, in microseconds.
const LONGEST_PAUSE: u64 = 100_000;
/// Actions without a random part.
const ACTIONS: [&str; 13] = [
    "clear",
    "restart",
    "power-cycle",
    "disconnect",
    "weight 100",
    "weight 500",
    "drop",
    "trip 2",
    "trip 5 heat",
    "seed 9",
    "halt",
    // A table so high that the arm soon meets it.
    "scene table 190; cube red 40 100 40 260; cylinder can 40 60 200 -40 250",
    "scene off",
];
/// Faults of a servo, and walls and pushes that a joint meets. Each lasts for one of the times in [`SHORTLY`].
const JOINT_FAULTS: [&str; 8] =
    ["late=20", "garbled=3", "stuck", "missing", "wall=80", "wall=100/500", "push=700", "push=-700"];
/// Other faults that last for one of the times in [`SHORTLY`].
const SHORT_FAULTS: [&str; 3] = ["7=thing=30", "7=thing=60/100", "supply=off"];
/// How long the faults of [`JOINT_FAULTS`] and [`SHORT_FAULTS`] last, in microseconds. After the longer time without supply,
/// the arm enters state 0 (D29).
const SHORTLY: [u64; 2] = [300_000, 1_200_000];
/// Faults that stay until they are cleared.
const ARM_FAULTS: [&str; 5] =
    ["line=loss=5", "line=corruption=5", "line=delay=3", "bus=echo", "supply=dips=100"];

/// Collects the lines of a session.
#[derive(Clone, Debug, Default)]
struct SessionLines(Arc<Mutex<String>>);

impl SessionLines {
    fn add(&self, line: &dyn std::fmt::Display) {
        let mut text = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // Writing to a string does not fail.
        let _ = writeln!(text, "{line}");
    }
}

impl SessionRecorder for SessionLines {
    fn add(&mut self, entry: &Entry) {
        SessionLines::add(self, entry);
    }
}

/// The text of a recorded session of about two seconds of virtual time.
#[must_use]
pub fn random_session(seed: u64) -> String {
    let mut random = Random(Xoshiro256PlusPlus::seed_from_u64(seed));
    let lines = SessionLines::default();
    lines.add(&SessionHeader::default());
    let mut arm = Simulation::default();
    arm.set_recorder(lines.clone());
    for _ in 0..ACTS {
        random.act(&mut arm);
        arm.advance(Duration::from_micros(random.0.next_u64() % LONGEST_PAUSE));
    }
    drop(arm);
    std::mem::take(&mut lines.0.lock().unwrap_or_else(PoisonError::into_inner))
}

struct Random(Xoshiro256PlusPlus);

impl Random {
    /// A random number from 0 to `below` - 1.
    fn byte(&mut self, below: u8) -> u8 {
        u8::try_from(self.0.next_u64() % u64::from(below)).unwrap_or(0)
    }

    fn pick<T: Copy>(&mut self, items: &[T]) -> Option<T> {
        let index = self.byte(u8::try_from(items.len()).unwrap_or(u8::MAX));
        items.get(usize::from(index)).copied()
    }

    fn act(&mut self, arm: &mut Simulation) {
        match self.byte(12) {
            0..4 => arm.send_request(&Request::Read { address: self.byte(200), count: 1 + self.byte(50) }),
            4 => arm.send_request(&Request::Write { address: 46 + self.byte(7), values: &[self.byte(181)] }),
            5 => arm.send_request(&Request::Write { address: 53, values: &[self.byte(51)] }),
            6 => arm.send_request(&Request::Write { address: 28 + self.byte(2), values: &[self.byte(4)] }),
            7 => arm.send(&[self.byte(255), 0xAA, 0x77, self.byte(9), self.byte(255), self.byte(255)]),
            _ => {
                if let Some(action) = self.action() {
                    arm.act(action);
                }
            }
        }
    }

    fn action(&mut self) -> Option<Action> {
        let joint = self.pick(&Joint::ALL)?;
        Some(match self.byte(5) {
            0 => {
                let fault = format!("{}={}", joint.number(), self.pick(&JOINT_FAULTS)?);
                Action::Fault(fault.parse().ok()?, Some(Duration::from_micros(self.pick(&SHORTLY)?)))
            }
            4 => {
                let fault = self.pick(&SHORT_FAULTS)?.parse().ok()?;
                Action::Fault(fault, Some(Duration::from_micros(self.pick(&SHORTLY)?)))
            }
            1 => Action::Fault(self.pick(&ARM_FAULTS)?.parse().ok()?, None),
            2 => Action::Hand(joint, 4 * u16::from(self.byte(255))),
            _ => self.pick(&ACTIONS)?.parse().ok()?,
        })
    }
}
