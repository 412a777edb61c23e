//! Waits until joints are at their targets, as measured.

use std::time::Duration;

use protocol_core::time::Instant;
use sevenbot::fine::FineTargets;
use sevenbot::health::{Health, MoveWatch};
use sevenbot::map::{SPEED, TIME};
use sevenbot::units::move_duration;
use sevenbot::{Angle, Joint, MoveTime, Snapshot, Speed};

use super::failure::ProgramFailure;
use crate::arm_state::ArmState;
use crate::client::{BAUD, Client};
use crate::movement::PlayFailure;
use crate::stop::since_start;

/// A move may take twice its duration, plus this.
const MARGIN: Duration = Duration::from_secs(5);
/// After the set-points are there, the joints have this time to settle.
const SETTLE_TIME: Duration = Duration::from_secs(2);
/// A joint that is slower than this rests, in degrees per second.
const STILL: f32 = 1.0;
/// The claw, which may hold something away from its target.
const CLAW: usize = 6;

/// A move whose targets the arm has.
#[derive(Debug)]
pub(super) struct JointMove {
    targets: FineTargets,
    /// Of the joints with a target, as [`Joint::bit`]s.
    joints: u8,
    end: Duration,
    watch: MoveWatch,
    round: u64,
    /// The arm had other targets in the last round. A stop of another program writes them, and tells of itself one round later.
    has_other_targets: bool,
    /// Since when no set-point moves.
    resting: Option<Duration>,
}

impl JointMove {
    /// A move to these targets, which were written at `now`.
    pub(super) fn new(targets: FineTargets, now: Instant, registers: &Snapshot) -> Self {
        let with_target = Joint::ALL.into_iter().zip(&targets).filter(|(_, target)| target.is_some());
        let joints = with_target.fold(0, |bits, (joint, _)| bits | joint.bit());
        let now = since_start(now);
        let end = now + longest(&targets, registers) * 2 + MARGIN;
        Self {
            targets,
            joints,
            end,
            watch: MoveWatch::new(now, joints, BAUD),
            round: 0,
            has_other_targets: false,
            resting: None,
        }
    }

    /// Are the joints there?
    pub(super) fn poll(&mut self, now: Instant, client: &Client) -> Result<bool, ProgramFailure> {
        if client.rounds() == self.round {
            return Ok(false);
        }
        self.round = client.rounds();
        let (now, registers) = (since_start(now), client.registers());
        self.watch.registers(now, registers)?;
        let (health, state) = (Health::new(registers), client.state());
        let other = self.other_targets(&health);
        if std::mem::replace(&mut self.has_other_targets, !other.is_empty()) && !other.is_empty() {
            return Err(ProgramFailure::OtherTargets(other));
        }
        if self.has_other_targets {
            return Ok(false);
        }
        let away = health.away_from_targets(self.joints);
        if state.moving & self.joints != 0 {
            self.resting = None;
            return if now < self.end { Ok(false) } else { Err(not_reached(away)) };
        }
        if away.is_empty() && self.is_still(&state) {
            return Ok(true);
        }
        let since = *self.resting.get_or_insert(now);
        // Firmware without a status block does not tell which joints move.
        let end = if health.faults.is_some() { since + SETTLE_TIME } else { self.end };
        match (now < end, away.is_empty()) {
            (true, _) => Ok(false),
            (false, true) => Ok(true),
            (false, false) => Err(not_reached(away)),
        }
    }

    /// The joints that have other targets than these: something else moves them.
    fn other_targets(&self, health: &Health) -> Vec<Joint> {
        let joints = health.joints.iter().zip(&self.targets);
        let other = joints.filter(|(joint, target)| {
            let is_claw = usize::from(joint.joint.index()) == CLAW;
            // In whole degrees where the arm has no others.
            let is_same = |target: &sevenbot::FineAngle| {
                joint.target == *target || joint.target == target.nearest().into()
            };
            !is_claw && target.as_ref().is_some_and(|target| !is_same(target))
        });
        other.map(|(joint, _)| joint.joint).collect()
    }

    fn is_still(&self, state: &ArmState) -> bool {
        let mut ours = state.velocities.iter().zip(&self.targets).filter(|(_, target)| target.is_some());
        ours.all(|(velocity, _)| velocity.abs() < STILL)
    }
}

fn not_reached(away: Vec<(Joint, u8, u8)>) -> ProgramFailure {
    ProgramFailure::Arm(PlayFailure::NotReached(away))
}

/// The duration of the slowest joint, at the speeds and times of the registers.
fn longest(targets: &FineTargets, registers: &Snapshot) -> Duration {
    let health = Health::new(registers);
    let moves = health.joints.iter().zip(targets).filter_map(|(joint, target)| {
        let to = (*target)?.nearest().degrees();
        let degrees = joint.position.map_or(Angle::MAX_DEGREES, |from| from.nearest().degrees().abs_diff(to));
        let speed = Speed::from_steps(registers.at(SPEED.of(joint.joint))).unwrap_or(Speed::MAXIMUM);
        let time = MoveTime::from_steps(registers.at(TIME.of(joint.joint))).unwrap_or(MoveTime::NONE);
        Some(move_duration(degrees, speed, time))
    });
    moves.max().unwrap_or_default()
}
