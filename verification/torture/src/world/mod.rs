//! A deterministic simulation of one arm: the real controller, simulated servos, a flash and a host, in virtual time.
//!
//! ```text
//!   RequestGenerator ─▶ HostToArm ─▶ ┌────────────┐ ─▶ corruption ─▶ DisturbedBus   RegisterModel   register values
//!                                    │ Controller │ ◀─ corruption ◀─                CommandChecker  servo commands
//!          (checked) ◀─ ArmToHost ◀─ └────────────┘ ─▶ SettingsStorage on a flash   StatusChecker   reported status
//!                                                                                   MotionChecker   joint angles
//! ```
//!
//! The simulation steps from event to event. The same seed and scenario reproduce every byte.

mod attempts;
mod command_checker;
mod controller_loop;
mod corruption;
mod disturbed_bus;
mod event_log;
mod extended_model;
mod extended_requests;
mod fault_injection;
mod host_link;
mod host_request;
mod joint_truth;
mod let_go_rule;
mod limit_verdict;
mod map21_model;
mod map21_requests;
mod motion_checker;
mod outside_ending;
mod outside_injection;
mod parameters;
mod power;
mod protection_model;
mod push_rule;
mod reachable_range;
mod register_model;
mod report_checker;
mod request_effects;
mod request_generator;
#[cfg(test)]
mod scripted_arm;
mod servo_replies;
mod settings_storage;
mod state;
mod status_checker;
mod status_reply;
mod supply_rule;
mod watchdog_model;
mod written_targets;

use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use crate::per_joint::PerJoint;
use crate::scenario::Scenario;
use crate::seeded_rng::SeededRng;
use crate::violation::{Check, Violation};
use crate::world_counts::WorldCounts;
use disturbed_bus::DisturbedBus;
use event_log::EventLog;
use parameters::WorldParameters;
use protection_model::PROTECTION;
use request_generator::{HostHabits, RequestGenerator};
pub use state::TortureWorld;
use state::{PendingRequest, PowerState, PoweredArm};
use status_checker::StatusChecker;
use supply_rule::SupplyRule;

/// The host pauses while more than this many requests are not executed.
const MAX_PENDING: usize = 64;
/// The host pauses while the bytes on its line need longer than this to arrive.
const MAX_QUEUE_TIME: Duration = Duration::from_millis(200);
/// The length of such a pause.
const HOST_PAUSE: Duration = Duration::from_millis(100);

/// A world that violated a rule.
#[derive(Debug)]
pub struct FailedWorld {
    /// Its seed. The same seed and scenario repeat the world.
    pub seed: u64,
    /// Its scenario, which was given or which the seed selected.
    pub scenario: &'static Scenario,
    /// The rule whose violation ended the world.
    pub violation: Violation,
    /// The last events, the time of the violation and the parameters of the world.
    pub log: String,
}

impl TortureWorld {
    /// A world at its start. `seed` determines all that is random in it.
    #[must_use]
    pub fn new(seed: u64, scenario: &'static Scenario) -> Self {
        let mut rng = SeededRng::new(seed);
        let now = Instant::ZERO;
        let parameters = WorldParameters::draw(&mut rng);
        Self {
            seed,
            scenario,
            now,
            bus: DisturbedBus::new(now, parameters.plant(), parameters.reply_time_bounds()),
            storage: parameters.storage(),
            parameters,
            generator: RequestGenerator::new(now, scenario.settings_per_mille, HostHabits::of(seed)),
            power: PowerState::Off { until: now, servos_too: false },
            is_servo: true,
            stalled_until: now,
            next_fault_at: now + rng.wait(scenario.mean_interval),
            hand: None,
            endings: Vec::new(),
            supply_rule: SupplyRule::default(),
            log: EventLog::default(),
            counts: WorldCounts::default(),
            rng,
        }
    }

    /// Simulates this much virtual time.
    ///
    /// # Errors
    /// A rule was violated. The world must not be used after that.
    pub fn run(&mut self, time: Duration) -> Result<WorldCounts, Box<FailedWorld>> {
        let end = self.now + time;
        while self.now < end {
            self.step().map_err(|violation| Box::new(self.failed(violation)))?;
        }
        let mut counts = self.counts;
        counts.micros = self.now.as_micros();
        counts.disturbed_servo_frames = self.bus.disturbed_frames;
        counts.undetected_errors = self.bus.undetected_errors;
        if let PowerState::On(arm) = &self.power {
            counts += arm.command_checker.counts();
        }
        Ok(counts)
    }

    fn failed(&self, violation: Violation) -> FailedWorld {
        let time = event_log::seconds(self.now);
        let log = format!("{}{time:>20}  {violation}\n{:?}", self.log, self.parameters);
        FailedWorld { seed: self.seed, scenario: self.scenario, violation, log }
    }

    fn step(&mut self) -> Check {
        self.now = self.next_event().max(self.now + Duration::from_micros(1));
        self.advance()?;
        if let PowerState::On(arm) = &self.power {
            self.is_servo = arm.model.is_servo();
        }
        self.bus.check_motion(self.now, self.is_servo, self.is_guarded(), self.push_limits())
    }

    fn advance(&mut self) -> Check {
        if self.now >= self.next_fault_at {
            self.inject_fault();
        }
        self.end_outside();
        self.move_hand();
        match std::mem::replace(&mut self.power, PowerState::Taken) {
            PowerState::Off { until, servos_too } if self.now >= until => self.power_up(servos_too),
            PowerState::On(arm) => self.run_arm(arm),
            off => {
                self.power = off;
                Ok(())
            }
        }
    }

    /// True if the controller protects the servos, and has run for so long that it knows their state.
    fn is_guarded(&self) -> bool {
        matches!(&self.power, PowerState::On(arm)
            if arm.model.get(PROTECTION) == 1 && arm.status_checker.is_settled(self.now))
    }

    /// The push limits in 0.1 %; `None` for a push that the controller does not limit.
    fn push_limits(&self) -> PerJoint<Option<i16>> {
        match &self.power {
            PowerState::On(arm) => PerJoint(Joint::ALL.map(|joint| arm.model.push_limit(joint))),
            _ => PerJoint::all(None),
        }
    }

    fn next_event(&self) -> Instant {
        let hand = self.hand.as_ref().map_or(Instant::FAR_FUTURE, |hand| hand.next_at);
        let external = self.next_fault_at.min(hand).min(self.next_ending());
        match &self.power {
            PowerState::On(arm) => {
                let inputs = [arm.to_arm.next_arrival(), self.bus.deadline(), Some(arm.wake_at)];
                let shell = inputs.into_iter().flatten().min().unwrap_or(Instant::FAR_FUTURE);
                let shell = shell.max(self.stalled_until);
                external.min(shell).min(arm.status_checker.next_at).min(self.generator.next_at)
            }
            PowerState::Off { until, .. } => external.min(*until),
            PowerState::Taken => external,
        }
    }

    /// Executes the events of this step while the power is on.
    fn run_arm(&mut self, mut arm: Box<PoweredArm>) -> Check {
        arm.to_arm.arrive(self.now);
        if self.now >= self.generator.next_at {
            self.send_requests(&mut arm);
        }
        let is_on = self.now < self.stalled_until || self.run_loop(&mut arm)?;
        if is_on && self.now >= arm.status_checker.next_at {
            arm.check_status(self.now, &self.bus, StatusChecker::check)?;
            let is_checked = self.supply_rule.check(self.now, arm.controller.registers())?;
            self.counts.checked_stops += u64::from(is_checked);
        }
        if is_on {
            self.power = PowerState::On(arm);
        } else {
            self.power_down(&arm, true);
        }
        Ok(())
    }

    fn send_requests(&mut self, arm: &mut PoweredArm) {
        if arm.pending.len() > MAX_PENDING || arm.to_arm.free_at() > self.now + MAX_QUEUE_TIME {
            self.generator.next_at = self.now + HOST_PAUSE;
            return;
        }
        let transmissions = self.generator.next_transmissions(self.now, &mut self.rng);
        if transmissions.iter().any(|transmission| transmission.request.is_none()) {
            self.counts.corrupted_bursts += 1;
            arm.status_checker.link_was_disturbed = true;
        }
        for transmission in transmissions {
            let label = if transmission.request.is_some() { "host" } else { "host, corrupted" };
            let mut arrived_at = self.now;
            for (pause, bytes) in &transmission.parts {
                arrived_at = arm.to_arm.send(self.now, *pause, bytes);
                self.log.host(arrived_at, label, bytes);
            }
            if let Some(request) = transmission.request {
                self.counts.requests += 1;
                arm.status_checker.false_headers += request.false_headers();
                arm.pending.push_back(PendingRequest { request, arrived_at });
            }
        }
    }
}
