//! Parks an arm: moves it to a pose in which friction holds every joint, and lets it go there.
//!
//! ```text
//!   forearm away from its limit ──▶ rear arm upright ──▶ park pose ──▶ damping ──▶ watched: does a joint sink?
//! ```
//!
//! The motors go to damping (state 0), not to forceless (state 2). So a joint that carries weight after all sinks slowly, and is
//! driven again as soon as the watch sees it.

use std::time::Duration;

use protocol_core::registers::Joint;
use protocol_core::registers::map::{MOTOR_STATE, PRESENT_POSITION, motor_state};

use super::error::MoveError;
use super::joint_move::JointMove;
use super::observer::Observer;
use super::pace::{Pace, PaceBefore};
use crate::arm::Arm;
use crate::fine_angle::FineAngle;
use crate::fine_state::FineTargets;
use crate::health::{MoveCheck, Problem, ProblemKind};
use crate::units::Speed;
use host_link::Span;

/// The pose in degrees: rear arm upright, forearm folded up and back, tool pointing up. Joints 1, 6 and 7 carry no weight and stay.
///
/// Found on the simulated arm without payload: no joint carries more than its friction holds (`docs/design.md`).
pub const PARK_POSE: [Option<u8>; 7] = [None, Some(90), Some(0), Some(90), Some(48), None, None];

/// A forearm at a greater angle first moves to this angle. Then the linkage stays below its limit of 161 degrees when the rear
/// arm becomes upright.
const FOREARM_LIMIT_DEGREES: u8 = 120;
/// The speed of the way to the pose: 19 degrees/s.
const SPEED_STEPS: u8 = 10;
/// The arm is watched for this time after it was let go.
const WATCH_TIME: Duration = Duration::from_secs(2);
/// The same for a pose of the user. From some poses a damped joint creeps by 1 degree in 15 s, and by 100 degrees in a
/// minute.
const WATCH_TIME_OF_OWN_POSE: Duration = Duration::from_secs(15);
/// Joints that were let go have settled after this time.
const SETTLING_TIME: Duration = Duration::from_secs(5);
const POLL_PERIOD: Duration = Duration::from_millis(50);
/// A joint that moves by more than this after it was let go, in hundredths of a degree, does not stay.
const STAYS_HUNDREDTHS: u16 = 200;
/// The same once the joints have settled: more than one count of a servo.
const CREEPS_HUNDREDTHS: u16 = 30;

/// Why an arm is not parked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParkError {
    /// The move to the pose or the restoring of the speeds failed: the motors are as they were. Or the order to let go failed, or
    /// the check after it, for another reason than a sinking joint.
    #[error(transparent)]
    Move(#[from] MoveError),
    /// The joint sank when it was let go. The motors drive it again, and the arm holds.
    #[error(
        "not parked: joint {} sinks when it is let go; the arm holds again. Is something in the gripper, or is another pose \
         better for this arm?",
        joint.number()
    )]
    Sinks {
        /// The joint that was seen to move; of several, the one with the lowest number.
        joint: Joint,
    },
}

impl From<crate::error::Error> for ParkError {
    fn from(error: crate::error::Error) -> Self {
        Self::Move(error.into())
    }
}

impl Arm {
    /// Moves slowly to a pose, restores the speeds and durations, lets the arm go (motor state 0), and checks that it stays.
    /// Returns the positions at the end of the check.
    ///
    /// `pose`: `None` is [`PARK_POSE`], which is right for an arm with an empty gripper. The check then takes 2 s, otherwise 15 s.
    ///
    /// # Errors
    /// The motors do not drive the joints, the arm does not reach the pose, or an exchange failed. Or a joint moves by more than
    /// 2 degrees when it is let go, still moves after 5 seconds or has a problem, or the observer ends the check: then the arm
    /// holds again.
    pub fn park(
        &mut self,
        pose: Option<FineTargets>,
        observer: &mut dyn Observer,
    ) -> Result<[FineAngle; 7], ParkError> {
        self.driven_joints()?;
        let all_joints = self.park_positions()?.map(Some);
        let before = PaceBefore::read(self, &all_joints)?;
        let moved = self.go_to_park_pose(pose, observer);
        if moved.is_err() {
            // Without a hold, joints on their way would go on. Then `put_back` restores nothing, or on the maker's firmware changes
            // their speed. If the hold fails too, the error of the move is returned.
            let _ = self.hold_and_watch();
        }
        let restored = before.put_back(self);
        moved?;
        restored?;
        self.let_go_and_watch(pose.is_some(), observer)
    }

    fn go_to_park_pose(
        &mut self,
        pose: Option<FineTargets>,
        observer: &mut dyn Observer,
    ) -> Result<(), MoveError> {
        // Checks between two moves: after a restart of the controller the slow speed is lost.
        let mut check = MoveCheck::begin(self, 0)?;
        let slowly = Pace { speed: Speed::from_steps(SPEED_STEPS), time: None };
        for targets in park_way(pose, self.park_positions()?) {
            slowly.set(self, &targets)?;
            check.check(self)?;
            JointMove::begin_fine(self, targets)?.finish(self, observer)?;
        }
        Ok(())
    }

    fn let_go_and_watch(
        &mut self,
        is_own_pose: bool,
        observer: &mut dyn Observer,
    ) -> Result<[FineAngle; 7], ParkError> {
        let start = self.park_positions()?;
        self.write_motion(MOTOR_STATE.address, &[motor_state::DAMPING])?;
        let stayed = self.watch_parked(&start, is_own_pose, observer);
        let holds_again = match &stayed {
            Err(ParkError::Sinks { .. } | ParkError::Move(MoveError::Interrupted)) => true,
            // Problems of single joints: the other joints hold what they can.
            Err(ParkError::Move(MoveError::Problems(problems))) => {
                problems.iter().all(|problem| problem.joint.is_some())
            }
            _ => false,
        };
        if holds_again {
            self.write_motion(MOTOR_STATE.address, &[motor_state::SERVO])?;
        }
        stayed
    }

    fn watch_parked(
        &mut self,
        start: &[FineAngle; 7],
        is_own_pose: bool,
        observer: &mut dyn Observer,
    ) -> Result<[FineAngle; 7], ParkError> {
        // A position in whole degrees may change by one without a real movement.
        let creeps = if self.has_extended_block()? { CREEPS_HUNDREDTHS } else { STAYS_HUNDREDTHS };
        let begin = self.now();
        let end = begin + if is_own_pose { WATCH_TIME_OF_OWN_POSE } else { WATCH_TIME };
        let mut settled = None;
        let mut check = MoveCheck::of_positions(self);
        loop {
            let now = self.park_positions()?;
            check.check(self).map_err(MoveError::from)?;
            if self.read_span(Span::of(&MOTOR_STATE))?.byte(&MOTOR_STATE) != motor_state::DAMPING {
                return Err(MoveError::Problems(vec![Problem::of_arm(ProblemKind::Restarted)]).into());
            }
            if self.now() >= begin + SETTLING_TIME {
                settled.get_or_insert(now);
            }
            let crept = settled.and_then(|settled| moved_joint(&settled, &now, creeps));
            if let Some(joint) = crept.or(moved_joint(start, &now, STAYS_HUNDREDTHS)) {
                return Err(ParkError::Sinks { joint });
            }
            if self.now() >= end {
                return Ok(now);
            }
            if !observer.goes_on() {
                return Err(MoveError::Interrupted.into());
            }
            observer.pause(self, POLL_PERIOD);
        }
    }

    /// The measured positions: in hundredths of a degree if the arm has them.
    fn park_positions(&mut self) -> Result<[FineAngle; 7], crate::error::Error> {
        let whole = self.read_span(Span::of(&PRESENT_POSITION))?.joints(&PRESENT_POSITION);
        let mut positions = whole.map(|degrees| FineAngle::from(crate::units::Angle::from_register(degrees)));
        if let Some(fine) = self.fine_state_if_served()? {
            for (position, measured) in positions.iter_mut().zip(fine.positions) {
                *position = measured.unwrap_or(*position);
            }
        }
        Ok(positions)
    }
}

/// The poses on the way. The way to [`PARK_POSE`] keeps the linkage of joints 2 and 3 within its limits; a pose of the user is
/// approached directly.
#[must_use]
pub fn park_way(pose: Option<FineTargets>, now: [FineAngle; 7]) -> Vec<FineTargets> {
    if let Some(pose) = pose {
        return vec![pose];
    }
    let park =
        PARK_POSE.map(|degrees| degrees.map(|degrees| crate::units::Angle::from_register(degrees).into()));
    let only = |joint: usize, target: Option<FineAngle>| {
        let mut targets = [None; 7];
        targets.iter_mut().skip(joint).take(1).for_each(|slot| *slot = target);
        targets
    };
    let limit = FineAngle::from(crate::units::Angle::from_register(FOREARM_LIMIT_DEGREES));
    let [_, _, forearm, ..] = now;
    let [_, rear, ..] = park;
    let down = (forearm > limit).then(|| only(2, Some(limit)));
    down.into_iter().chain([only(1, rear), park]).collect()
}

fn moved_joint(start: &[FineAngle; 7], now: &[FineAngle; 7], hundredths: u16) -> Option<Joint> {
    let mut pairs = Joint::ALL.into_iter().zip(start.iter().zip(now));
    pairs
        .find(|(_, (start, now))| start.hundredths().abs_diff(now.hundredths()) > hundredths)
        .map(|(joint, _)| joint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated::{self, SharedSimulation, SimulationConfig};

    /// The true angles in thousandths of a degree.
    fn angles(simulation: &SharedSimulation) -> [i32; 7] {
        simulation.with(|simulation| Joint::ALL.map(|joint| simulation.plant().angle(joint)))
    }

    #[test]
    fn a_parked_arm_stays_where_it_is_with_free_motors() {
        for start in
            [[90, 90, 65, 90, 90, 90, 80], [30, 130, 60, 90, 90, 60, 20], [140, 40, 130, 60, 120, 90, 80]]
        {
            let (mut arm, simulation) = simulated::arm(SimulationConfig::default()).expect("an arm");
            arm.driven_joints().expect("it is driven");
            JointMove::begin(&mut arm, start.map(Some))
                .and_then(|sent| sent.finish(&mut arm, &mut ()))
                .expect("a pose");
            arm.park(None, &mut ()).unwrap_or_else(|error| panic!("{start:?}: {error}"));
            let parked = angles(&simulation);
            arm.write(MOTOR_STATE.address, &[motor_state::FORCELESS]).expect("a write");
            arm.sleep(Duration::from_secs(60));
            for (joint, (before, after)) in parked.into_iter().zip(angles(&simulation)).enumerate() {
                assert!((after - before).abs() <= 2_000, "joint {}: {before} to {after}", joint + 1);
            }
        }
    }

    #[test]
    fn the_way_keeps_the_linkage_within_its_limits() {
        for (rear, forearm) in (0..=180_u8).flat_map(|rear| (0..=180_u8).map(move |forearm| (rear, forearm)))
        {
            let (rear, forearm) = (i32::from(rear), i32::from(forearm));
            let is_legal = |rear: i32, forearm: i32| (19..=161).contains(&(forearm - 65 + rear));
            if !is_legal(rear, forearm) {
                continue;
            }
            let whole = |degrees: i32| FineAngle::from_degrees(degrees.into()).expect("an angle");
            let mut now =
                [whole(90), whole(rear), whole(forearm), whole(90), whole(90), whole(90), whole(80)];
            for targets in park_way(None, now) {
                for (joint, target) in now.iter_mut().zip(targets) {
                    *joint = target.unwrap_or(*joint);
                }
                let [rear, forearm] = [now[1], now[2]].map(|angle| i32::from(angle.nearest().degrees()));
                assert!(is_legal(rear, forearm), "{rear} {forearm}");
            }
        }
    }

    #[test]
    fn a_pose_of_the_user_is_watched_until_a_joint_that_creeps_is_seen() {
        let pose = |rear: u8, forearm: u8| {
            let whole = |degrees: u8| FineAngle::from_degrees(degrees.into());
            Some([None, whole(rear), whole(forearm), whole(90), whole(50), None, None])
        };
        let (mut arm, simulation) = simulated::arm(SimulationConfig::default()).expect("an arm");
        arm.driven_joints().expect("it is driven");
        assert_eq!(arm.park(pose(92, 2), &mut ()).map(drop), Err(ParkError::Sinks { joint: Joint::ALL[2] }));
        assert!(arm.health().is_ok_and(|health| health.is_driven()), "it holds again");
        arm.park(pose(95, 0), &mut ()).expect("parked");
        let parked = angles(&simulation);
        arm.sleep(Duration::from_secs(120));
        assert_eq!(angles(&simulation), parked);
    }

    #[test]
    fn an_arm_that_sinks_is_held_again() {
        let (mut arm, simulation) = simulated::arm(SimulationConfig::default()).expect("an arm");
        arm.driven_joints().expect("it is driven");
        let level = [90, 90, 65, 90, 90, 90, 80].map(|degrees| FineAngle::from_degrees(degrees.into()));
        assert_eq!(arm.park(Some(level), &mut ()).map(drop), Err(ParkError::Sinks { joint: Joint::ALL[2] }));
        let held = angles(&simulation);
        arm.sleep(Duration::from_secs(10));
        let [.., after, _, _, _, _] = angles(&simulation);
        assert!((after - held[2]).abs() < 1_000, "{} to {after}", held[2]);
        assert!(arm.health().is_ok_and(|health| health.is_driven()));
    }
}
