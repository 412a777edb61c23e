//! Measures what becomes of the arm at obstacles, with and without its protection (`torture obstacles`).
//!
//! A joint is driven against a wall, in a matrix of poses, payloads and speeds, by a target or by a stream of points. A
//! second table has alarms that are forced on a servo, and emergency stops under a stream. A third one has things between
//! the claws. All values are true values of the plant, sampled once per millisecond of virtual time. Push is the load of a
//! joint that stands still, in 0.1 % of its stall torque.

use std::fmt::{self, Display};

use arm_sim::flash::Flash;
use arm_sim::plant::{Plant, SupplyFault, Thing, Wall};
use arm_sim::servo::Trip;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::TorqueCodes;
use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    EFFECTOR_TYPE, FINE_TARGET, GRIP_LIMIT, MOTOR_STATE, PROTECTION, SERVO_ALARMS, SET_POINT_PERIOD, SPEED,
    TARGET_POSITION, effector,
};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;

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
const PAYLOADS_G: [u16; 3] = [0, 100, 300];
const SPEEDS: [u8; 3] = [10, 60, 0];
/// The wall is this far from the joint, and the target this far, in degrees.
const WALL_DISTANCE: u8 = 8;
const TARGET_DISTANCE: u8 = 30;
/// The time for a pose, and the time at an obstacle.
const SETTLE_MS: u64 = 3_000;
const PUSH_MS: u64 = 5_000;
/// The time after the obstacle has left.
const AFTER_MS: u64 = 2_000;
/// The push is averaged over this time, and from this time on it is lasting.
const AVERAGED_MS: usize = 100;
const LASTING_AFTER_MS: usize = 400;
/// The time between two points of a stream, in milliseconds.
const PERIOD_MS: u8 = 20;
const CLAW: Joint = Joint::ALL[6];

/// A simulated arm in virtual time.
struct Arm {
    world: SimulatedArm<Flash>,
    now: Instant,
}

impl Arm {
    /// An arm that was just switched on, with or without protection.
    fn new(is_protected: bool) -> Self {
        let now = Instant::ZERO;
        let setup = ArmConfig { chip_id: [0; 6], is_paced: false, torque_codes: TorqueCodes::default() };
        let mut arm = Self { world: SimulatedArm::new(now, setup, Flash::in_memory(), Plant::new(now)), now };
        arm.run(SETTLE_MS);
        arm.write(PROTECTION.address, &[u8::from(is_protected)]);
        arm
    }

    fn write(&mut self, address: u8, values: &[u8]) {
        let mut frame = FrameBuffer::new();
        Request::Write { address, values }.encode(&mut frame);
        self.world.host_send(self.now, &frame);
    }

    fn run(&mut self, millis: u64) {
        for _ in 0..millis {
            self.now = self.now + Duration::from_millis(1);
            self.world.advance(self.now, true);
        }
    }

    fn angle(&self, joint: Joint) -> i32 {
        self.world.plant().angle(joint)
    }

    fn register(&self, address: u8) -> u8 {
        self.world.controller().registers().get(address)
    }
}

/// What became of a joint at a wall.
#[derive(Clone, Copy, Debug, Default)]
pub struct WallResult {
    /// The greatest push, in 0.1 %.
    pub peak: u16,
    /// The greatest average push, from 400 ms after the joint came to the wall, in 0.1 %.
    pub lasting: u16,
    /// The servo's own overload protection has switched it off.
    pub has_tripped: bool,
    /// How far from the wall the joint was after the wall was taken away, in thousandths of a degree.
    pub sag: u32,
}

/// Drives a joint against a wall.
#[must_use]
pub fn push_against_wall(joint: Joint, case: &WallCase, is_protected: bool) -> WallResult {
    let index = usize::from(joint.index());
    let mut arm = Arm::new(is_protected);
    arm.world.plant_mut().set_load(case.payload_g);
    arm.write(TARGET_POSITION.address, &case.pose);
    arm.run(SETTLE_MS);
    let from = case.pose.get(index).copied().unwrap_or(90);
    let wall = i32::from(from + WALL_DISTANCE) * 1_000;
    arm.world.plant_mut().set_wall(joint, Some(Wall { millidegrees: wall, stiffness: None }));
    arm.write(SPEED.of(joint), &[case.speed]);
    let mut result = WallResult::default();
    let mut pushes = Vec::new();
    for millis in 0..PUSH_MS {
        case.drive(&mut arm, joint, from, millis);
        arm.run(1);
        result.has_tripped |=
            arm.register(SERVO_ALARMS.address) != 0 && is_protected || !arm.world.plant().has_torque(joint);
        if (arm.angle(joint) - wall).abs() < 500 {
            pushes.push(arm.world.plant().load(joint).unsigned_abs());
        }
    }
    result.peak = pushes.iter().copied().max().unwrap_or(0);
    let lasting = pushes.get(LASTING_AFTER_MS..).unwrap_or(&[]);
    let average = |window: &[u16]| window.iter().map(|&push| u32::from(push)).sum::<u32>() / 100;
    let averages = lasting.windows(AVERAGED_MS).map(average);
    result.lasting = u16::try_from(averages.max().unwrap_or(0)).unwrap_or(u16::MAX);
    arm.world.plant_mut().set_wall(joint, None);
    for _ in 0..AFTER_MS {
        arm.run(1);
        // From the wall: a joint whose servo switched itself off may have fallen before the wall leaves.
        result.sag = result.sag.max(arm.angle(joint).abs_diff(wall));
    }
    result
}

/// How a joint is driven against a wall.
#[derive(Clone, Copy, Debug)]
pub struct WallCase {
    pose: [u8; 6],
    payload_g: u16,
    speed: u8,
    is_streamed: bool,
}

impl WallCase {
    fn all() -> impl Iterator<Item = Self> {
        POSES.into_iter().flat_map(|pose| {
            PAYLOADS_G.into_iter().flat_map(move |payload_g| {
                SPEEDS.into_iter().flat_map(move |speed| {
                    [false, true].map(|is_streamed| Self { pose, payload_g, speed, is_streamed })
                })
            })
        })
    }

    /// Sends the target at the start, or the next point of the stream. The points go to the target in a second and stay.
    fn drive(&self, arm: &mut Arm, joint: Joint, from: u8, millis: u64) {
        if !self.is_streamed {
            if millis == 0 {
                arm.write(TARGET_POSITION.of(joint), &[from + TARGET_DISTANCE]);
            }
            return;
        }
        if millis == 0 {
            arm.write(SET_POINT_PERIOD.address, &[PERIOD_MS, 0]);
        }
        // The stream ends before the wall is taken away, so that what moves then is what was wound up.
        if millis.is_multiple_of(PERIOD_MS.into()) && millis < PUSH_MS - 1_500 {
            let way = u64::from(TARGET_DISTANCE) * 100 * millis.min(1_000) / 1_000;
            let point = u16::from(from) * 100 + u16::try_from(way).unwrap_or(0);
            arm.write(FINE_TARGET.of(joint), &point.to_le_bytes());
        }
    }
}

/// The worst of some results, joint by joint.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    peak: u16,
    lasting: u16,
    trips: u32,
    sag: u32,
}

impl Worst {
    fn of(results: &[WallResult]) -> Self {
        results.iter().fold(Self::default(), |worst, result| Self {
            peak: worst.peak.max(result.peak),
            lasting: worst.lasting.max(result.lasting),
            trips: worst.trips + u32::from(result.has_tripped),
            sag: worst.sag.max(result.sag),
        })
    }

    fn cells(&self) -> String {
        let percent = |permille: u16| format!("{}.{} %", permille / 10, permille % 10);
        format!("{} | {} | {} | {}", percent(self.peak), percent(self.lasting), self.trips, degrees(self.sag))
    }
}

/// Degrees with one decimal, rounded up.
fn degrees(millidegrees: u32) -> String {
    let tenths = millidegrees.div_ceil(100);
    format!("{}.{}°", tenths / 10, tenths % 10)
}

/// The tables of all experiments.
#[derive(Clone, Debug)]
pub struct ObstacleTables(String);

impl ObstacleTables {
    /// Runs all experiments.
    #[must_use]
    pub fn measure() -> Self {
        Self(format!("{}\n{}\n{}", walls(), alarms_and_stops(), grips()))
    }
}

impl Display for ObstacleTables {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.0)
    }
}

fn walls() -> String {
    let cases: Vec<WallCase> = WallCase::all().collect();
    let mut table = format!(
        "{} cases a joint.\n\n| joint | protection | peak push | lasting push | trips | sag |\n{}\n",
        cases.len(),
        "| --- | --- | --- | --- | --- | --- |"
    );
    for joint in Joint::ALL.into_iter().take(6) {
        for (is_protected, name) in [(false, "off"), (true, "on")] {
            let results: Vec<WallResult> =
                cases.iter().map(|case| push_against_wall(joint, case, is_protected)).collect();
            table += &format!("| {} | {name} | {} |\n", joint.number(), Worst::of(&results).cells());
        }
    }
    table
}

/// What happens to an arm that streams.
#[derive(Clone, Copy, Debug)]
enum Mishap {
    Trip(Trip),
    EmergencyStop(u64),
}

impl Mishap {
    const ALL: [(Self, &'static str); 5] = [
        (Self::Trip(Trip::Overload), "overload forced on joint 3"),
        (Self::Trip(Trip::Heat), "heat forced on joint 3"),
        (Self::EmergencyStop(300), "supply off for 0.3 s"),
        (Self::EmergencyStop(3_000), "supply off for 3 s"),
        (Self::EmergencyStop(30_000), "supply off for 30 s"),
    ];
}

/// Joint 3 is let go, or all joints are, with 100 g, while joint 1 streams.
fn alarms_and_stops() -> String {
    let mut table = String::from(
        "| what happens | protection | joint 3 sinks by | joint 1 goes to its stream at | state after it |\n\
         | --- | --- | --- | --- | --- |\n",
    );
    for (mishap, name) in Mishap::ALL {
        for (is_protected, protection) in [(false, "off"), (true, "on")] {
            table += &format!("| {name} | {protection} | {} |\n", mishap_cells(mishap, is_protected));
        }
    }
    table
}

fn mishap_cells(mishap: Mishap, is_protected: bool) -> String {
    let [one, _, three, ..] = Joint::ALL;
    let mut arm = Arm::new(is_protected);
    arm.world.plant_mut().set_load(100);
    arm.write(SET_POINT_PERIOD.address, &[PERIOD_MS, 0]);
    arm.run(SETTLE_MS);
    let before = arm.angle(three);
    match mishap {
        Mishap::Trip(trip) => arm.world.plant_mut().trip(three, trip),
        Mishap::EmergencyStop(millis) => {
            arm.world.plant_mut().set_supply_fault(Some(SupplyFault::Off));
            stream(&mut arm, one, millis);
            arm.world.plant_mut().set_supply_fault(None);
        }
    }
    let (mut fastest, mut last) = (0, arm.angle(one));
    for _ in 0..200 {
        stream(&mut arm, one, PERIOD_MS.into());
        fastest = fastest.max(arm.angle(one).abs_diff(last) / u32::from(PERIOD_MS));
        last = arm.angle(one);
    }
    let sag = arm.angle(three).abs_diff(before);
    let state = arm.register(MOTOR_STATE.address);
    format!("{} | {fastest} °/s | {state}", degrees(sag))
}

/// Streams the same far point.
fn stream(arm: &mut Arm, joint: Joint, millis: u64) {
    for _ in 0..millis.div_ceil(PERIOD_MS.into()) {
        arm.write(FINE_TARGET.of(joint), &13_000_u16.to_le_bytes());
        arm.run(PERIOD_MS.into());
    }
}

/// A thing between the claws for an hour.
fn grips() -> String {
    let mut table = String::from(
        "| between the claws | grip limit | peak push | push after a minute | after an hour | temperature | alarms |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (name, limit, stiffness) in [("egg", 10, Some(100)), ("brick", 40, None)] {
        let mut arm = Arm::new(true);
        arm.write(EFFECTOR_TYPE.address, &[effector::GRIPPER]);
        arm.write(GRIP_LIMIT.address, &[limit]);
        arm.world.plant_mut().set_thing(Some(Thing { millidegrees: 60_000, stiffness }));
        arm.write(SPEED.of(CLAW), &[10]);
        arm.write(TARGET_POSITION.of(CLAW), &[20]);
        let push = |arm: &Arm| f64::from(arm.world.plant().load(CLAW).unsigned_abs()) / 10.0;
        let mut peak = 0.0_f64;
        for _ in 0..60_000 {
            arm.run(1);
            peak = peak.max(push(&arm));
        }
        let minute = push(&arm);
        for _ in 0..3_600 {
            arm.run(1_000);
        }
        let hour = push(&arm);
        let (heat, alarms) = (arm.register(255), arm.register(SERVO_ALARMS.address));
        table += &format!(
            "| {name} | {limit} % | {peak:.1} % | {minute:.1} % | {hour:.1} % | {heat} °C | {alarms} |\n"
        );
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn d27_a_wall_trips_a_servo_only_without_protection() {
        let case = WallCase { pose: POSES[1], payload_g: 100, speed: 60, is_streamed: false };
        let joint = Joint::ALL[1];
        let [without, with] = [false, true].map(|is_protected| push_against_wall(joint, &case, is_protected));
        assert!(without.has_tripped && !with.has_tripped, "{without:?} {with:?}");
        assert!(with.lasting <= 750 && with.sag < 5_500, "{with:?}");
        assert!(without.sag > 10_000, "{without:?}");
    }
}
