//! A joint that is driven against a wall: its push at the wall, and its sag when the wall is removed.

use std::collections::VecDeque;

use arm_sim::plant::Wall;
use protocol_core::registers::Joint;
use protocol_core::registers::map::{FINE_TARGET, SET_POINT_PERIOD, SPEED, TARGET_POSITION};
use protocol_core::time::{Duration, Instant};

use super::arm::{ObstacleArm, PERIOD_MS, SETTLE_TIME, degrees, percent, start};

/// The poses: angles of joints 1 to 6 in degrees, within the linkage.
const POSES: [[u8; 6]; 8] = [
    [90, 90, 65, 90, 90, 90],
    [60, 60, 60, 90, 90, 90],
    [120, 120, 60, 90, 60, 90],
    [90, 45, 80, 60, 90, 60],
    [45, 100, 40, 120, 120, 120],
    [135, 70, 100, 90, 45, 45],
    [90, 110, 90, 45, 90, 90],
    [30, 50, 50, 135, 100, 130],
];
/// The pose of [`WallCase::few`].
const FEW_POSE: [u8; 6] = POSES[0];

const SPEEDS: [u8; 3] = [10, 60, 0];
/// The distances of the wall and of the target from the start of the joint, in degrees.
const WALL_DISTANCE: i16 = 8;
const TARGET_DISTANCE: i16 = 30;
/// The time at the wall, and the time after the wall has gone.
const PUSH_TIME: Duration = Duration::from_millis(5_000);
const AFTER_TIME: Duration = Duration::from_millis(2_000);
/// The time in which a stream reaches its target, and the time of its last point. The last point comes before the wall is
/// removed, so a motion after the removal is the effect of windup.
const STREAM_TIME: Duration = Duration::from_millis(1_000);
const STREAM_END: Duration = Duration::from_millis(3_500);
/// The lasting push is the greatest average over this time.
const AVERAGED_TIME: Duration = Duration::from_millis(100);
/// The averages begin this long after the joint came to the wall.
const LASTING_AFTER: Duration = Duration::from_millis(400);
/// A joint that was away from the wall for this long has bounced off.
const BOUNCE_TIME: Duration = Duration::from_millis(50);

/// How a joint is driven against a wall.
#[derive(Clone, Copy, Debug)]
pub struct WallCase {
    joint: Joint,
    pose: [u8; 6],
    payload_g: u16,
    speed: u8,
    is_streamed: bool,
    /// True if the wall is at a smaller angle than the joint.
    is_behind: bool,
}

impl WallCase {
    pub(super) const PAYLOADS_G: [u16; 3] = [0, 100, 300];

    /// Each joint but the claw in each pose, with each payload, at each speed, by a target and by a stream. The side of the
    /// wall alternates from pose to pose and from speed to speed.
    pub(super) fn all() -> Vec<Self> {
        let mut cases = Vec::new();
        for joint in Joint::ALL.into_iter().take(6) {
            for ((number, pose), payload_g) in
                (0..).zip(POSES).flat_map(|pose| Self::PAYLOADS_G.map(|grams| (pose, grams)))
            {
                for (side, speed) in (number..).zip(SPEEDS) {
                    cases.extend([false, true].map(|is_streamed| Self {
                        joint,
                        pose,
                        payload_g,
                        speed,
                        is_streamed,
                        is_behind: side % 2 == 0,
                    }));
                }
            }
        }
        cases
    }

    /// Joints 2 and 3 in one pose, without and with a payload, by a target and by a stream.
    pub(super) fn few() -> Vec<Self> {
        let [_, two, three, ..] = Joint::ALL;
        let is_among = |case: &Self| {
            [two, three].contains(&case.joint)
                && case.pose == FEW_POSE
                && case.payload_g != 100
                && case.speed == 60
        };
        Self::all().into_iter().filter(is_among).collect()
    }

    /// The cases at speed 60, for experiments without a wall.
    pub(super) fn at_usual_speed() -> Vec<Self> {
        Self::all().into_iter().filter(|case| case.speed == 60).collect()
    }

    pub(super) const fn joint(&self) -> Joint {
        self.joint
    }

    pub(super) const fn payload_g(&self) -> u16 {
        self.payload_g
    }

    /// True for one joint of each pose. Experiments that concern all joints at once need no more.
    pub(super) fn is_of_its_pose(&self) -> bool {
        let number = POSES.iter().position(|pose| *pose == self.pose);
        number.is_some_and(|number| number % 6 == usize::from(self.joint.index()))
    }

    /// Starts an arm with the payload, moves it to the pose, and sets the speed of the joint. For a stream, sets its period, too.
    pub(super) fn start<A: ObstacleArm>(&self, is_protected: bool) -> Result<A, A::Error> {
        let mut arm: A = start(is_protected)?;
        arm.plant().set_load(self.payload_g);
        arm.write(TARGET_POSITION.address, &self.pose)?;
        arm.run(SETTLE_TIME)?;
        arm.write(SPEED.of(self.joint), &[self.speed])?;
        if self.is_streamed {
            arm.write(SET_POINT_PERIOD.address, &[PERIOD_MS, 0])?;
        }
        Ok(arm)
    }

    /// Drives the joint towards its target for this time.
    pub(super) fn drive_for<A: ObstacleArm>(&self, arm: &mut A, time: Duration) -> Result<(), A::Error> {
        let begun = arm.now();
        self.drive(arm, Duration::ZERO)?;
        while arm.now() - begun < time {
            arm.run(Duration::from_millis(PERIOD_MS.into()))?;
            if self.is_streamed {
                self.drive(arm, arm.now() - begun)?;
            }
        }
        Ok(())
    }

    /// The angle at this distance from the start of the joint towards the wall, in degrees.
    fn towards_wall(&self, distance: i16) -> u8 {
        let from = self.pose.get(usize::from(self.joint.index())).copied().unwrap_or(90);
        let distance = if self.is_behind { -distance } else { distance };
        from.saturating_add_signed(i8::try_from(distance).unwrap_or(0))
    }

    fn wall(&self) -> i32 {
        i32::from(self.towards_wall(WALL_DISTANCE)) * 1_000
    }

    /// Sends the target, or the point of the stream at this time since its start.
    fn drive<A: ObstacleArm>(&self, arm: &mut A, since: Duration) -> Result<(), A::Error> {
        if !self.is_streamed {
            return arm.write(TARGET_POSITION.of(self.joint), &[self.towards_wall(TARGET_DISTANCE)]);
        }
        let part = since.as_micros().min(STREAM_TIME.as_micros());
        let [from, to] = [0, TARGET_DISTANCE].map(|distance| i64::from(self.towards_wall(distance)) * 100);
        let way = (to - from) * i64::try_from(part).unwrap_or(0) / 1_000_000;
        let point = u16::try_from(from + way).unwrap_or(0);
        arm.write(FINE_TARGET.of(self.joint), &point.to_le_bytes())
    }

    /// Drives the joint against its wall for [`PUSH_TIME`]. The sag in the result is 0.
    fn push<A: ObstacleArm>(&self, arm: &mut A) -> Result<WallResult, A::Error> {
        let begun = arm.now();
        let mut next = Some(begun);
        let mut pushes = Vec::new();
        let mut has_tripped = false;
        while arm.now() - begun < PUSH_TIME {
            if let Some(due) = next
                && arm.now() >= due
            {
                let since = arm.now() - begun;
                self.drive(arm, since)?;
                let following = due + Duration::from_millis(PERIOD_MS.into());
                next = (self.is_streamed && following < begun + STREAM_END).then_some(following);
            }
            arm.step()?;
            has_tripped |= !arm.plant().has_torque(self.joint);
            if (arm.plant().angle(self.joint) - self.wall()).abs() < 500 {
                pushes.push((arm.now(), arm.plant().load(self.joint).unsigned_abs()));
            }
        }
        let peak = pushes.iter().map(|(_, push)| *push).max().unwrap_or(0);
        Ok(WallResult { peak, lasting: lasting(&pushes), has_tripped, sag: 0 })
    }
}

/// The greatest average push. The first [`LASTING_AFTER`] of each contact do not count, and a joint that bounces off begins a
/// new contact.
fn lasting(pushes: &[(Instant, u16)]) -> u16 {
    let contacts = pushes.chunk_by(|(before, _), (at, _)| *at - *before < BOUNCE_TIME);
    contacts.map(lasting_of_contact).max().unwrap_or(0)
}

fn lasting_of_contact(pushes: &[(Instant, u16)]) -> u16 {
    let Some(&(first, _)) = pushes.first() else { return 0 };
    let settled = first + LASTING_AFTER;
    let (mut window, mut sum, mut greatest) = (VecDeque::new(), 0, 0);
    for &(at, push) in pushes.iter().filter(|(at, _)| *at >= settled) {
        window.push_back((at, push));
        sum += u32::from(push);
        while let Some(&(oldest, push)) = window.front()
            && oldest + AVERAGED_TIME <= at
        {
            window.pop_front();
            sum -= u32::from(push);
        }
        if at >= settled + AVERAGED_TIME {
            let count = u32::try_from(window.len()).unwrap_or(u32::MAX);
            greatest = greatest.max(sum.checked_div(count).unwrap_or(0));
        }
    }
    u16::try_from(greatest).unwrap_or(u16::MAX)
}

/// The push, the trip and the sag of a joint at a wall.
#[derive(Clone, Copy, Debug, Default)]
pub struct WallResult {
    /// The greatest push within half a degree of the wall, in 0.1 %.
    pub peak: u16,
    /// The greatest average push over 100 ms, from 400 ms after the joint came to the wall, in 0.1 %.
    pub lasting: u16,
    /// The servo has switched itself off.
    pub has_tripped: bool,
    /// The largest distance of the joint from the wall's place after the wall was removed, in thousandths of a degree.
    pub sag: u32,
}

/// Drives the joint of a case against a wall, then removes the wall and measures the sag.
///
/// # Errors
/// The arm fails.
pub fn push_against_wall<A: ObstacleArm>(
    case: &WallCase,
    is_protected: bool,
) -> Result<WallResult, A::Error> {
    let mut arm: A = case.start(is_protected)?;
    let wall = case.wall();
    arm.plant().set_wall(case.joint, Some(Wall { millidegrees: wall, stiffness: None }));
    let mut result = case.push(&mut arm)?;
    arm.plant().set_wall(case.joint, None);
    let gone = arm.now();
    while arm.now() - gone < AFTER_TIME {
        arm.step()?;
        // Measure from the wall: a joint whose servo switched itself off may have fallen before the wall was removed.
        result.sag = result.sag.max(arm.plant().angle(case.joint).abs_diff(wall));
    }
    Ok(result)
}

/// A case, whether the arm was protected, and the result.
type Outcome = (WallCase, bool, WallResult);

/// The tables of the worst results: by joint, payload, speed, kind of target, side of the wall, and pose.
pub(super) fn tables<A: ObstacleArm>(cases: &[WallCase]) -> Result<String, A::Error> {
    let mut outcomes: Vec<Outcome> = Vec::new();
    for (case, is_protected) in cases.iter().flat_map(|case| [(case, false), (case, true)]) {
        outcomes.push((*case, is_protected, push_against_wall::<A>(case, is_protected)?));
    }
    let by = |name, key: fn(&WallCase) -> String| table(name, &outcomes, key);
    let tables = [
        by("joint", |case| case.joint.number().to_string()),
        by("payload", |case| format!("{} g", case.payload_g)),
        by("speed", |case| case.speed.to_string()),
        by("driven by", |case| if case.is_streamed { "a stream" } else { "a target" }.to_owned()),
        by("wall", |case| {
            if case.is_behind { "at a smaller angle" } else { "at a greater angle" }.to_owned()
        }),
        by("pose", |case| format!("{:?}", case.pose)),
    ];
    Ok(tables.into_iter().flatten().collect::<Vec<_>>().join("\n"))
}

/// The worst results of the cases with the same key. `None` if all cases have the same key.
fn table(name: &str, outcomes: &[Outcome], key: fn(&WallCase) -> String) -> Option<String> {
    let mut keys: Vec<String> = Vec::new();
    for key in outcomes.iter().map(|(case, ..)| key(case)) {
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    if keys.len() < 2 {
        return None;
    }
    let mut table = format!(
        "| {name} | cases | protection | peak push | lasting push | trips | sag |\n{}\n",
        "| --- | --: | --- | --: | --: | --: | --: |"
    );
    for (wanted, is_protected) in keys.iter().flat_map(|key| [(key, false), (key, true)]) {
        let is_wanted =
            |(case, protection, _): &&Outcome| key(case) == *wanted && *protection == is_protected;
        let results: Vec<_> = outcomes.iter().filter(is_wanted).map(|(.., result)| *result).collect();
        let protection = if is_protected { "on" } else { "off" };
        table += &format!("| {wanted} | {} | {protection} | {} |\n", results.len(), worst(&results));
    }
    Some(table)
}

/// The cells of a row: the largest values of some results, and the number of trips.
fn worst(results: &[WallResult]) -> String {
    let worst = |value: fn(&WallResult) -> u16| results.iter().map(value).max().unwrap_or(0);
    let trips = results.iter().filter(|result| result.has_tripped).count();
    let sag = results.iter().map(|result| result.sag).max().unwrap_or(0);
    let (peak, lasting) = (worst(|result| result.peak), worst(|result| result.lasting));
    format!("{} | {} | {trips} | {}", percent(peak), percent(lasting), degrees(sag))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacles::simulated::SimulatedObstacleArm;

    #[test]
    fn d27_a_wall_trips_a_servo_only_without_protection() {
        let case = WallCase {
            joint: Joint::ALL[1],
            pose: POSES[1],
            payload_g: 100,
            speed: 60,
            is_streamed: false,
            is_behind: false,
        };
        let [without, with] = [false, true].map(|is_protected| {
            let Ok(result) = push_against_wall::<SimulatedObstacleArm>(&case, is_protected);
            result
        });
        assert!(without.has_tripped && !with.has_tripped, "{without:?} {with:?}");
        assert!(with.lasting <= 750 && with.sag < 5_500, "{with:?}");
        assert!(without.sag > 10_000, "{without:?}");
    }

    #[test]
    fn every_case_has_its_wall_and_its_target_within_reach() {
        let cases = WallCase::all();
        assert_eq!(cases.len(), 6 * 8 * 3 * 3 * 2);
        for case in &cases {
            let [wall, target] = [WALL_DISTANCE, TARGET_DISTANCE].map(|distance| case.towards_wall(distance));
            assert_eq!(wall.abs_diff(target), 22, "{case:?}");
            assert!(target <= 180, "{case:?}");
        }
        assert_eq!(WallCase::few().len(), 8);
    }

    #[test]
    fn the_lasting_push_is_the_greatest_average_of_100_ms_after_400_ms() {
        let pushes = |push: fn(u64) -> u16| -> Vec<_> {
            (0..1_000).map(|ms| (Instant::from_micros(ms * 1_000), push(ms))).collect()
        };
        assert_eq!(lasting(&pushes(|ms| if ms < 400 { 1_000 } else { 500 })), 500);
        assert_eq!(lasting(&pushes(|ms| if (600..650).contains(&ms) { 1_000 } else { 0 })), 500);
        assert_eq!(lasting(&pushes(|_| 700)[..450]), 0, "too short to last");
        assert_eq!(lasting(&[]), 0);
    }

    #[test]
    fn a_joint_that_bounces_off_comes_to_the_wall_again() {
        let push = |ms: u64| (Instant::from_micros(ms * 1_000), if ms < 1_100 { 1_000 } else { 600 });
        let bounced: Vec<_> = (0..100).chain(1_000..2_000).map(push).collect();
        assert_eq!(lasting(&bounced), 600);
        let stayed: Vec<_> = (0..2_000).map(push).collect();
        assert_eq!(lasting(&stayed), 1_000);
    }
}
