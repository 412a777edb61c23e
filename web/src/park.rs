//! Parks the arm: goes to a pose in which friction holds it, switches the motors to damping, and watches whether it stays.
//!
//! The way there and the limits are those of `sevenbot park`.

use protocol_core::time::{Duration, Instant};
use sevenbot::fine::FineTargets;
use sevenbot::map::{MOTOR_STATE, SPEED, motor_state};
use sevenbot::moves::park_way;
use sevenbot::{FineAngle, Joint};

use crate::arm_state::{ArmState, target_frame};
use crate::client::Client;

/// 19 degrees per second.
const SPEED_STEPS: u8 = 10;
/// A joint this near to its target has arrived, in degrees.
const ARRIVED: f32 = 3.0;
/// A joint that moves by more than this after it was let go does not stay, in degrees.
const STAYS: f32 = 2.0;
/// Time for each part of the way: 180 degrees take 10 s.
const LONGEST_MOVE: Duration = Duration::from_micros(20_000_000);
/// The arm is watched for this time after it was let go.
const WATCH_TIME: Duration = Duration::from_micros(2_000_000);

/// How parking goes on or has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParkProgress {
    /// It goes on.
    Moving,
    /// The arm is parked.
    Parked,
    /// The arm did not get to the pose or did not stay there. It holds.
    Failed,
}

/// A park in progress.
#[derive(Debug)]
pub struct Park {
    way: Vec<FineTargets>,
    speeds: [u8; 7],
    /// When the present part of the way was sent, and how many complete rounds of reads there were then.
    sent: Option<(Instant, u64)>,
    /// The angles and the time at which the arm was let go.
    let_go: Option<([f32; 7], Instant)>,
}

impl Park {
    /// Begins at the present pose of the arm. `speeds`: the speed registers before it. `None` if a joint is not measured.
    #[must_use]
    pub fn new(state: &ArmState, speeds: [u8; 7]) -> Option<Self> {
        let mut now = [FineAngle::from_hundredths(0)?; 7];
        for (angle, measured) in now.iter_mut().zip(state.measured) {
            *angle = FineAngle::from_degrees(f64::from(measured?))?;
        }
        let mut way = park_way(None, now);
        way.reverse();
        Some(Self { way, speeds, sent: None, let_go: None })
    }

    /// The speed registers before parking, to be written back afterwards.
    #[must_use]
    pub const fn speeds(&self) -> [u8; 7] {
        self.speeds
    }

    /// Writes what is due.
    pub fn poll(&mut self, now: Instant, client: &mut Client) -> ParkProgress {
        let state = client.state();
        if let Some((start, since)) = self.let_go {
            return self.watch(now, client, &state, start, since);
        }
        if !state.problems.is_empty() || state.motor_state != motor_state::SERVO {
            client.write(now, SPEED.address, &self.speeds);
            return ParkProgress::Failed;
        }
        match (self.sent, self.way.last()) {
            (None, Some(targets)) => {
                let frames = frames(client, targets);
                client.write(now, SPEED.address, &[SPEED_STEPS; 7]);
                for (address, values) in frames {
                    client.write(now, address, &values);
                }
                self.sent = Some((now, client.rounds()));
            }
            (Some((at, rounds)), Some(targets)) => {
                // The next round may have been on its way before these targets.
                if client.rounds() >= rounds + 2 && has_arrived(&state, targets) {
                    self.way.pop();
                    self.sent = None;
                } else if now >= at + LONGEST_MOVE {
                    client.write(now, SPEED.address, &self.speeds);
                    return ParkProgress::Failed;
                }
            }
            (_, None) => {
                client.write(now, SPEED.address, &self.speeds);
                client.write(now, MOTOR_STATE.address, &[motor_state::DAMPING]);
                self.let_go = Some((state.angles(), now));
            }
        }
        ParkProgress::Moving
    }

    fn watch(
        &self,
        now: Instant,
        client: &mut Client,
        state: &ArmState,
        start: [f32; 7],
        since: Instant,
    ) -> ParkProgress {
        let stays = start.iter().zip(state.angles()).all(|(before, after)| (before - after).abs() <= STAYS);
        match (stays, now >= since + WATCH_TIME) {
            (false, _) => {
                client.write(now, MOTOR_STATE.address, &[motor_state::SERVO]);
                ParkProgress::Failed
            }
            (true, true) => ParkProgress::Parked,
            (true, false) => ParkProgress::Moving,
        }
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
