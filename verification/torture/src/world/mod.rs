//! One arm in one world: the real controller, simulated servos, a flash, a host. Time is a number.
//!
//! ```text
//!   Client ──▶ ToArm ──▶ ┌────────────┐ ──▶ damage ──▶ Servos            Model     what registers must hold
//!                        │ Controller │ ◀── damage ◀──                   Commands  what servos may be told
//!   (checked) ◀─ ToHost ◀└────────────┘ ──▶ Settings on a flash          Audit     whether the arm says the truth
//! ```
//!
//! The world steps from event to event. The same seed and scenario give the same world, to the last byte.

mod asked;
mod audit;
mod client;
mod commands;
mod damage;
mod hold;
mod line;
mod model;
mod notes;
mod power;
mod servos;
mod settings;
mod shell;
mod trouble;

use std::collections::VecDeque;

use motion_core::Controller;
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use crate::dice::Dice;
use crate::scenario::Scenario;
use crate::tally::Tally;
use crate::violation::{Check, Violation, ensure};
use asked::Asked;
use audit::Audit;
use client::Client;
use commands::Commands;
use line::{ToArm, ToHost};
use model::Model;
use notes::Notes;
use power::{Power, Traits};
use servos::Servos;
use settings::Settings;
use trouble::Hand;

/// How many outputs in a row without a wait are none too many: each request may have one, and more than
/// these do not wait.
const MOST_OUTPUTS: u32 = 4_000;

/// A request on its way, or waiting.
#[derive(Debug)]
struct Pending {
    asked: Asked,
    /// When its last byte was through.
    arrived: Instant,
}

/// What runs from power-up to power-down, with what is known about it.
#[derive(Debug)]
struct Life {
    controller: Controller,
    /// The bytes of its last output.
    said: Vec<u8>,
    model: Model,
    commands: Commands,
    audit: Audit,
    to_arm: ToArm,
    to_host: ToHost,
    pending: VecDeque<Pending>,
    due: Instant,
    /// The power is cut in the next save.
    save_is_cut: bool,
    /// Waits in a row that were over before they began.
    hasty_waits: u32,
}

/// A world.
#[derive(Debug)]
pub struct World {
    seed: u64,
    scenario: &'static Scenario,
    now: Instant,
    dice: Dice,
    traits: Traits,
    servos: Servos,
    settings: Box<dyn Settings>,
    client: Client,
    power: Power,
    /// Are joints to be driven, or were they when the controller stopped?
    is_servo: bool,
    /// The shell does not get to run before.
    stalled_until: Instant,
    trouble_at: Instant,
    hand: Option<Hand>,
    notes: Notes,
    tally: Tally,
}

/// How a world came to a bad end.
#[derive(Debug)]
pub struct Failure {
    /// Its seed.
    pub seed: u64,
    /// What happened in it.
    pub scenario: &'static Scenario,
    /// What was violated.
    pub violation: Violation,
    /// When, and what led to it, in lines.
    pub story: String,
}

impl World {
    /// The world of a seed.
    #[must_use]
    pub fn new(seed: u64, scenario: &'static Scenario) -> Self {
        let mut dice = Dice::new(seed);
        let now = Instant::ZERO;
        let traits = Traits::draw(&mut dice);
        Self {
            seed,
            scenario,
            now,
            servos: Servos::new(now, traits.plant(), traits.bounds_of_lateness()),
            settings: traits.settings(),
            traits,
            client: Client::new(now, scenario.settings_per_mille),
            power: Power::Off { until: now, servos_too: false },
            is_servo: true,
            stalled_until: now,
            trouble_at: now + dice.wait(scenario.every),
            hand: None,
            notes: Notes::default(),
            tally: Tally::default(),
            dice,
        }
    }

    /// Lets so much virtual time pass.
    ///
    /// # Errors
    /// A rule was violated; the world is of no use after that.
    pub fn run(&mut self, time: Duration) -> Result<Tally, Box<Failure>> {
        let end = self.now + time;
        while self.now < end {
            self.step().map_err(|violation| Box::new(self.failure(violation)))?;
        }
        self.tally.micros = self.now.as_micros();
        self.tally.damaged_servo_frames = self.servos.damaged_frames;
        self.tally.deceptions = self.servos.deceptions;
        Ok(self.tally)
    }

    fn failure(&self, violation: Violation) -> Failure {
        let story = format!("{}{:>20}  {violation}\n{:?}", self.notes, notes::clock(self.now), self.traits);
        Failure { seed: self.seed, scenario: self.scenario, violation, story }
    }

    fn step(&mut self) -> Check {
        self.now = self.next_event().max(self.now + Duration::from_micros(1));
        self.go_on()?;
        if let Power::On(life) = &self.power {
            self.is_servo = life.model.is_servo();
        }
        self.servos.look(self.now, self.is_servo)
    }

    fn go_on(&mut self) -> Check {
        if self.now >= self.trouble_at {
            self.trouble();
        }
        self.move_hand();
        match std::mem::replace(&mut self.power, Power::None) {
            Power::Off { until, servos_too } if self.now >= until => self.power_up(servos_too),
            Power::On(life) => self.live(life),
            off => {
                self.power = off;
                Ok(())
            }
        }
    }

    fn next_event(&self) -> Instant {
        let hand = self.hand.as_ref().map_or(Instant::FAR_FUTURE, Hand::next_at);
        let outside = self.trouble_at.min(hand);
        match &self.power {
            Power::On(life) => {
                let inside = [life.to_arm.next_arrival(), self.servos.deadline(), Some(life.due)];
                let inside = inside.into_iter().flatten().min().unwrap_or(Instant::FAR_FUTURE);
                let late = inside.max(self.stalled_until);
                outside.min(late).min(life.audit.next_at).min(self.client.next_at)
            }
            Power::Off { until, .. } => outside.min(*until),
            Power::None => outside,
        }
    }

    /// What happens while the power is on.
    fn live(&mut self, mut life: Box<Life>) -> Check {
        life.to_arm.arrive(self.now);
        if self.now >= self.client.next_at {
            self.host_speaks(&mut life);
        }
        let goes_on = self.now < self.stalled_until || self.turn(&mut life)?;
        if goes_on && self.now >= life.audit.next_at {
            life.audited(self.now, &self.servos, Audit::look)?;
        }
        if goes_on {
            self.power = Power::On(life);
        } else {
            self.power_down(&life, true);
        }
        Ok(())
    }

    fn host_speaks(&mut self, life: &mut Life) {
        // A host that hears no answers does not go on for ever.
        if life.pending.len() > 64 || life.to_arm.free_at() > self.now + Duration::from_millis(200) {
            self.client.next_at = self.now + Duration::from_millis(100);
            return;
        }
        let pieces = self.client.burst(self.now, &mut self.dice);
        if pieces.iter().any(|piece| piece.asked.is_none()) {
            self.tally.damaged_bursts += 1;
            life.audit.line_was_disturbed = true;
        }
        for piece in pieces {
            let mut arrived = self.now;
            for (pause, bytes) in &piece.parts {
                arrived = life.to_arm.send(self.now, *pause, bytes);
                self.notes.host(arrived, if piece.asked.is_some() { "host" } else { "host, damaged" }, bytes);
            }
            if let Some(asked) = piece.asked {
                self.tally.requests += 1;
                life.audit.false_headers += asked.false_headers();
                life.pending.push_back(Pending { asked, arrived });
            }
        }
    }

    /// Every request that is whole, and behind which the line was silent for long enough, was carried out.
    fn check_pending(&self, life: &Life, room: usize) -> Check {
        let gap = protocol_core::wire::deframer::gap(life.controller.baud());
        let first = life.pending.front().map(|first| first.arrived + gap);
        // A write needs no room, and a read that of its answer (D5).
        let needs = life.pending.front().map_or(0, |first| first.asked.answer_length());
        let is_due = first.is_some_and(|due| due <= self.now) && room >= needs;
        let is_silent = life.to_arm.next_arrival().is_none_or(|at| at > self.now);
        let last = life.to_arm.last_taken_at();
        ensure(!(is_due && is_silent && self.now >= last + gap), || {
            format!("{} requests were not carried out: {:?}", life.pending.len(), life.pending.front())
        })
    }

    fn is_missing(life: &Life, joint: Joint) -> bool {
        let at = protocol_core::registers::map::MISSING_SERVOS.address;
        life.controller.registers().get(at) & joint.bit() != 0
    }
}
