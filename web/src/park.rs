//! Parks the arm: moves it to a pose in which friction holds it, switches the motors to damping, and checks that it stays there.
//!
//! ```text
//!   Park: two rounds of reads ──▶ the way, pose by pose ──▶ let go ──▶ ParkProgress
//!             └── motors off, a problem, a stop or a pause: ParkFailure ─────┘
//! ```
//!
//! The path, its speed and the time to check are the same as for `sevenbot park` with the standard pose. A failure on the way
//! stops the arm, unless another client has stopped it already. After a failure in the last stage, `holds_again` decides whether
//! the motors drive the arm again.

use protocol_core::time::{Duration, Instant};
use sevenbot::fine::FineTargets;
use sevenbot::health::{Health, MoveFault, MoveWatch};
use sevenbot::map::{MOTOR_STATE, SPEED, motor_state};
use sevenbot::moves::park_way;
use sevenbot::{FineAngle, Joint, Problem, ProblemKind, Snapshot};

use crate::arm_state::{ArmState, target_frame};
use crate::client::{BAUD, Client};
use crate::interruptions::{Interruptions, ROUNDS_TO_KNOW};
use crate::movement::{ALL_JOINTS, PlayFailure, start_anew};
use crate::stop::since_start;

/// The speed of the path, in steps of 1.9 degrees per second: 19 degrees per second.
const SPEED_STEPS: u8 = 10;
/// A joint has arrived if its distance from its target is at most this, in degrees.
const ARRIVED: f32 = 3.0;
/// A joint that moves by more than this after it was let go has sunk, in degrees.
const STAYS: f32 = 2.0;
/// The longest time for each part of the path. A turn of 180 degrees takes about 10 s.
const LONGEST_MOVE: Duration = Duration::from_micros(20_000_000);
/// The arm has to stay in its pose for this time after it was let go.
const WATCH_TIME: Duration = Duration::from_micros(2_000_000);

/// What [`Park::poll`] returns: whether the park goes on or has ended.
#[derive(Clone, Debug, PartialEq)]
pub enum ParkProgress {
    /// The park is not over yet.
    Moving,
    /// The arm was let go, and has stayed in its pose for 2 s.
    Parked,
    /// The park has failed, for this reason.
    Failed(ParkFailure),
}

/// Why the arm is not parked.
#[derive(Clone, Debug, PartialEq)]
pub enum ParkFailure {
    /// A joint was not measured since power-up. The arm was not moved.
    NotMeasured,
    /// The arm sank after it was let go. Its motors drive it again.
    Sank,
    /// The motors are off, the arm has a fault or did not reach the pose, or a stop or a pause of the page ended the park.
    Move(PlayFailure),
}

impl From<PlayFailure> for ParkFailure {
    fn from(failure: PlayFailure) -> Self {
        Self::Move(failure)
    }
}

impl From<MoveFault> for ParkFailure {
    fn from(fault: MoveFault) -> Self {
        Self::Move(PlayFailure::Arm(fault))
    }
}

#[derive(Debug)]
enum ParkStage {
    Start,
    /// Waits until this round of reads is complete.
    Beginning(u64),
    /// The remaining parts of the path, the current one last; and the time and round of reads at which the current part was sent,
    /// `None` before.
    Way(Vec<FineTargets>, Option<(Instant, u64)>),
    /// The angles in degrees and the time at which the arm was let go, and the round of reads that shows it.
    LetGo([f32; 7], Instant, u64),
}

/// A park in progress, which [`Self::poll`] drives.
#[derive(Debug)]
pub struct Park {
    /// The registers before the park, with the speeds to restore.
    before: Snapshot,
    stage: ParkStage,
    interruptions: Interruptions,
    watch: MoveWatch,
    /// The round of the last registers that were checked.
    watched_round: u64,
}

impl Park {
    /// Begins a park. `before` are the registers with the speeds to restore afterwards.
    #[must_use]
    pub fn new(before: Snapshot, now: Instant) -> Self {
        Self {
            before,
            stage: ParkStage::Start,
            interruptions: Interruptions::default(),
            watch: MoveWatch::new(since_start(now), ALL_JOINTS, BAUD),
            watched_round: 0,
        }
    }

    /// The speeds of the joints before the park, as in registers 32 to 38.
    #[must_use]
    pub fn speeds(&self) -> [u8; 7] {
        self.before.joints(&SPEED)
    }

    /// The registers before the park, with the speeds to restore.
    #[must_use]
    pub fn into_before(self) -> Snapshot {
        self.before
    }

    /// Ends the park early, because something else is about to move the arm. Moving joints hold.
    pub fn end(&self, now: Instant, client: &mut Client) {
        if matches!(self.stage, ParkStage::Way(..)) {
            client.hold(now, self.speeds());
        }
    }

    /// Writes the frames that are due. Call it with each picture.
    pub fn poll(&mut self, now: Instant, client: &mut Client) -> ParkProgress {
        match self.advance(now, client) {
            Ok(progress) => progress,
            Err(failure) => {
                match (&self.stage, &failure) {
                    // The arm holds already, and the server drops targets of this client, so a stop could not be confirmed.
                    (ParkStage::Way(..), ParkFailure::Move(PlayFailure::StoppedByAnother)) => {
                        client.write(now, SPEED.address, &self.speeds());
                    }
                    (ParkStage::Way(..), _) => client.stop(now, Some(self.speeds())),
                    (ParkStage::LetGo(..), failure) if holds_again(failure) => {
                        client.write(now, MOTOR_STATE.address, &[motor_state::SERVO]);
                    }
                    _ => {}
                }
                ParkProgress::Failed(failure)
            }
        }
    }

    fn advance(&mut self, now: Instant, client: &mut Client) -> Result<ParkProgress, ParkFailure> {
        if matches!(self.stage, ParkStage::Start) {
            start_anew(now, client);
            self.stage = ParkStage::Beginning(client.rounds() + ROUNDS_TO_KNOW);
        }
        self.check(now, client)?;
        let state = client.state();
        match &mut self.stage {
            ParkStage::Beginning(round) if client.rounds() >= *round => {
                self.stage = ParkStage::Way(way(&state)?, None)
            }
            ParkStage::Way(way, sent) => match (*sent, way.last()) {
                (None, Some(targets)) => {
                    client.write(now, SPEED.address, &[SPEED_STEPS; 7]);
                    for (address, values) in frames(client, targets) {
                        client.write(now, address, &values);
                    }
                    *sent = Some((now, client.rounds()));
                }
                (Some((at, rounds)), Some(targets)) => {
                    // The reads of the current round may be older than these targets.
                    if client.rounds() >= rounds + ROUNDS_TO_KNOW && has_arrived(&state, targets) {
                        way.pop();
                        *sent = None;
                    } else if now >= at + LONGEST_MOVE {
                        let away = Health::new(client.registers()).away_from_targets(ALL_JOINTS);
                        return Err(PlayFailure::NotReached(away).into());
                    }
                }
                (_, None) => {
                    client.write(now, SPEED.address, &self.before.joints(&SPEED));
                    client.write(now, MOTOR_STATE.address, &[motor_state::DAMPING]);
                    self.watch = MoveWatch::new(since_start(now), ALL_JOINTS, BAUD).of_positions();
                    self.stage = ParkStage::LetGo(state.angles(), now, client.rounds() + ROUNDS_TO_KNOW);
                }
            },
            ParkStage::LetGo(start, since, round) => {
                let is_known = client.rounds() >= *round;
                return watch_parked(now, &state, start, *since, is_known);
            }
            _ => {}
        }
        Ok(ParkProgress::Moving)
    }

    /// Fails if the arm does not move as it should, or something interrupts the park.
    fn check(&mut self, now: Instant, client: &Client) -> Result<(), ParkFailure> {
        self.interruptions.check_pause(now)?;
        // Fails if the arm is silent. The client reads all registers in any case, so the span to read is not needed.
        self.watch.question(since_start(now))?;
        let is_known = !matches!(self.stage, ParkStage::Beginning(round) if client.rounds() < round);
        if is_known && client.rounds() != self.watched_round {
            self.watched_round = client.rounds();
            self.interruptions.check_stops(client.registers())?;
            self.watch.registers(since_start(now), client.registers())?;
        }
        Ok(())
    }
}

/// The path from the measured positions to the park pose, in reverse order.
fn way(state: &ArmState) -> Result<Vec<FineTargets>, ParkFailure> {
    let angle = |degrees: f32| FineAngle::from_degrees(f64::from(degrees));
    let mut here = [FineAngle::from_hundredths(0).ok_or(ParkFailure::NotMeasured)?; 7];
    for (here, measured) in here.iter_mut().zip(state.measured) {
        *here = measured.and_then(angle).ok_or(ParkFailure::NotMeasured)?;
    }
    let mut way = park_way(None, here);
    way.reverse();
    Ok(way)
}

/// Fails if the arm sinks or its motors leave damping. `is_known`: the registers are newer than the write that let the arm go.
fn watch_parked(
    now: Instant,
    state: &ArmState,
    start: &[f32; 7],
    since: Instant,
    is_known: bool,
) -> Result<ParkProgress, ParkFailure> {
    if is_known && state.motor_state != motor_state::DAMPING {
        let restarted = Problem::of_arm(ProblemKind::Restarted);
        return Err(MoveFault::Problems(vec![restarted]).into());
    }
    if start.iter().zip(state.angles()).any(|(before, after)| (before - after).abs() > STAYS) {
        return Err(ParkFailure::Sank);
    }
    Ok(if now >= since + WATCH_TIME { ParkProgress::Parked } else { ParkProgress::Moving })
}

/// True if an arm that was let go has to be driven again after this failure. False if the whole arm has failed, as after a lost
/// supply, or if another client has stopped it.
fn holds_again(failure: &ParkFailure) -> bool {
    match failure {
        ParkFailure::Sank | ParkFailure::Move(PlayFailure::Paused(_)) => true,
        ParkFailure::Move(PlayFailure::Arm(MoveFault::Problems(problems))) => {
            problems.iter().all(|problem| problem.joint.is_some())
        }
        _ => false,
    }
}

fn frames(client: &Client, targets: &FineTargets) -> Vec<(u8, Vec<u8>)> {
    let joints = Joint::ALL.into_iter().zip(targets).filter_map(|(joint, target)| Some((joint, (*target)?)));
    let frame = |(joint, target): (Joint, FineAngle)| {
        #[expect(clippy::cast_possible_truncation, reason = "0 to 180 degrees")]
        target_frame(client.registers(), joint.number(), target.degrees() as f32)
    };
    joints.filter_map(frame).collect()
}

fn has_arrived(state: &ArmState, targets: &FineTargets) -> bool {
    let goals =
        state.angles().into_iter().zip(targets).filter_map(|(angle, target)| Some((angle, (*target)?)));
    let mut away = goals.map(|(angle, target)| (f64::from(angle) - target.degrees()).abs());
    state.moving == 0 && away.all(|degrees| degrees <= f64::from(ARRIVED))
}

#[cfg(test)]
mod tests;
