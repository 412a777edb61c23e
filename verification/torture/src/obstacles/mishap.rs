//! Alarms that are forced on a servo, and emergency stops. A stream of points for joint 1 begins with each of them.

use arm_sim::plant::SupplyFault;
use arm_sim::servo::Trip;
use protocol_core::registers::Joint;
use protocol_core::registers::map::{FINE_TARGET, MOTOR_STATE, SET_POINT_PERIOD};
use protocol_core::time::Duration;

use super::arm::{ObstacleArm, PERIOD_MS, SETTLE_TIME, degrees, start};

const PAYLOAD_G: u16 = 100;
/// The point that is streamed, in hundredths of a degree: 40 degrees from the standard pose of joint 1.
const POINT: u16 = 13_000;
/// The time of the measurement after an alarm, or after the supply came back.
const AFTER_TIME: Duration = Duration::from_millis(4_000);

/// A forced alarm, or an emergency stop.
#[derive(Clone, Copy, Debug)]
pub enum Mishap {
    /// An alarm that is forced on the servo of one joint.
    Trip(Trip),
    /// The servos are without supply for this many milliseconds.
    EmergencyStop(u64),
}

impl Mishap {
    /// All mishaps, in the order of the table.
    pub(super) const ALL: [Self; 5] = [
        Self::Trip(Trip::Overload),
        Self::Trip(Trip::Heat),
        Self::EmergencyStop(300),
        Self::EmergencyStop(3_000),
        Self::EmergencyStop(30_000),
    ];
    /// The emergency stops that are short enough for real time.
    pub(super) const SHORT_STOPS: [Self; 2] = [Self::EmergencyStop(300), Self::EmergencyStop(3_000)];

    fn name(self) -> String {
        match self {
            Self::Trip(Trip::Overload) => "overload forced on joint 3".to_owned(),
            Self::Trip(Trip::Heat) => "heat forced on joint 3".to_owned(),
            Self::EmergencyStop(millis) => format!("supply off for {}", seconds(millis)),
        }
    }
}

/// Seconds with one decimal.
pub(super) fn seconds(millis: u64) -> String {
    format!("{}.{} s", millis / 1_000, millis / 100 % 10)
}

/// The table of mishaps: joint 3 or all joints lose their torque, with a payload, while joint 1 follows a stream.
pub(super) fn table<A: ObstacleArm>(mishaps: &[Mishap]) -> Result<String, A::Error> {
    let mut table = String::from(
        "| what happens | protection | joint 3 sinks by | joint 1 goes to its stream at | state after it |\n\
         | --- | --- | --: | --: | --: |\n",
    );
    for mishap in mishaps {
        for (is_protected, protection) in [(false, "off"), (true, "on")] {
            let cells = cells::<A>(*mishap, is_protected)?;
            table += &format!("| {} | {protection} | {cells} |\n", mishap.name());
        }
    }
    Ok(table)
}

fn cells<A: ObstacleArm>(mishap: Mishap, is_protected: bool) -> Result<String, A::Error> {
    let [one, _, three, ..] = Joint::ALL;
    let mut arm: A = start(is_protected)?;
    arm.plant().set_load(PAYLOAD_G);
    arm.write(SET_POINT_PERIOD.address, &[PERIOD_MS, 0])?;
    arm.run(SETTLE_TIME)?;
    let before = arm.plant().angle(three);
    match mishap {
        Mishap::Trip(trip) => arm.plant().trip(three, trip),
        Mishap::EmergencyStop(millis) => {
            arm.plant().set_supply_fault(Some(SupplyFault::Off));
            stream(&mut arm, one, Duration::from_millis(millis))?;
            arm.plant().set_supply_fault(None);
        }
    }
    let fastest = stream(&mut arm, one, AFTER_TIME)?;
    let sag = arm.plant().angle(three).abs_diff(before);
    let state = arm.read(MOTOR_STATE.address)?;
    Ok(format!("{} | {fastest} °/s | {state}", degrees(sag)))
}

/// Streams the same far point for this time. Returns the greatest speed of the joint between two writes,
/// in degrees per second.
fn stream<A: ObstacleArm>(arm: &mut A, joint: Joint, time: Duration) -> Result<u64, A::Error> {
    let end = arm.now() + time;
    let mut fastest = 0;
    while arm.now() < end {
        let (before, angle) = (arm.now(), arm.plant().angle(joint));
        arm.write(FINE_TARGET.of(joint), &POINT.to_le_bytes())?;
        arm.run(Duration::from_millis(PERIOD_MS.into()))?;
        let way = u64::from(arm.plant().angle(joint).abs_diff(angle)) * 1_000;
        fastest = fastest.max(way.checked_div((arm.now() - before).as_micros()).unwrap_or(0));
    }
    Ok(fastest)
}
