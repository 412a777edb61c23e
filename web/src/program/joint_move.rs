//! Waits until joints have reached their targets, as measured.

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

/// The timeout of a move is twice its expected duration, plus this.
const MARGIN: Duration = Duration::from_secs(5);
/// The joints have this time to settle after the set-points have reached the targets.
const SETTLE_TIME: Duration = Duration::from_secs(2);
/// A joint that is slower than this is at rest, in degrees per second.
const STILL: f32 = 1.0;
/// The index of the claw's joint. The arm changes the target of a claw that an object stops (D27), so its target is not compared.
const CLAW: usize = 6;

/// A move whose targets the arm has confirmed.
#[derive(Debug)]
pub(super) struct ProgramMove {
    targets: FineTargets,
    /// The joints with a target, as [`Joint::bit`]s.
    joints: u8,
    /// The time at which the move has timed out, since the start of the clock.
    end: Duration,
    watch: MoveWatch,
    /// The round of the last registers that were checked.
    round: u64,
    /// The arm had other targets in the last round. They may come from a stop by another client, which the server reports up to
    /// one round later.
    has_other_targets: bool,
    /// The time since which no set-point moves; `None` while one moves.
    resting: Option<Duration>,
}

impl ProgramMove {
    /// Begins to wait at `now` for a move to these targets.
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

    /// Returns true when the joints have reached their targets.
    ///
    /// # Errors
    /// The arm has a problem, the joints have other targets, or they did not arrive in time.
    pub(super) fn poll(&mut self, now: Instant, client: &Client) -> Result<bool, ProgramFailure> {
        if client.rounds() == self.round {
            return Ok(false);
        }
        self.round = client.rounds();
        let (now, registers) = (since_start(now), client.registers());
        let (health, state) = (Health::new(registers), client.state());
        self.watch.registers(now, registers)?;
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
            return self.arrived(now, registers);
        }
        let since = *self.resting.get_or_insert(now);
        // Firmware without a status block does not report which joints move, so the timeout of the whole move applies.
        let end = if health.faults.is_some() { since + SETTLE_TIME } else { self.end };
        match (now < end, away.is_empty()) {
            (true, _) => Ok(false),
            (false, true) => self.arrived(now, registers),
            (false, false) => Err(not_reached(away)),
        }
    }

    /// Returns `Ok(true)`, or fails if these registers show a new alarm: this move is not checked again.
    fn arrived(&mut self, now: Duration, registers: &Snapshot) -> Result<bool, ProgramFailure> {
        self.watch.end();
        self.watch.registers(now, registers)?;
        Ok(true)
    }

    /// The joints, except the claw, whose targets in the registers differ from the targets of this move: something else moves
    /// them.
    fn other_targets(&self, health: &Health) -> Vec<Joint> {
        let joints = health.joints.iter().zip(&self.targets);
        let other = joints.filter(|(joint, target)| {
            let is_claw = usize::from(joint.joint.index()) == CLAW;
            // An arm without the extended block has targets in whole degrees.
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

/// The expected duration of the slowest joint, at the speeds and times of the registers.
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
