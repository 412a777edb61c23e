//! A gripper that holds a thing between its claws for a long time.

use arm_sim::plant::Thing;
use protocol_core::registers::Joint;
use protocol_core::registers::map::{
    EFFECTOR_TYPE, GRIP_LIMIT, SERVO_ALARMS, SERVO_TEMPERATURE, SPEED, TARGET_POSITION, effector,
};
use protocol_core::time::Duration;

use super::arm::{ObstacleArm, percent, start};

const CLAW: Joint = Joint::ALL[6];
/// The peak push is measured for this time, in seconds.
const SETTLED_S: u64 = 30;
/// The angle at which the claw touches the thing, and the target of the claw, in degrees.
const THING_AT: i32 = 60;
const TARGET: u8 = 20;

/// The table of grips: a soft thing at the lowest grip limit, and a hard thing at the default limit.
pub(super) fn table<A: ObstacleArm>(time: Duration) -> Result<String, A::Error> {
    let mut table = format!(
        "| between the claws | grip limit | peak push | push after {SETTLED_S} s | after {} min | temperature | alarms |\n\
         | --- | --: | --: | --: | --: | --: | --: |\n",
        time.as_micros() / 60_000_000
    );
    for (name, limit, stiffness) in [("egg", 10, Some(100)), ("brick", 40, None)] {
        let thing = Thing { millidegrees: THING_AT * 1_000, stiffness };
        table += &format!("| {name} | {limit} % | {} |\n", cells::<A>(thing, limit, time)?);
    }
    Ok(table)
}

fn cells<A: ObstacleArm>(thing: Thing, limit: u8, time: Duration) -> Result<String, A::Error> {
    let mut arm: A = start(true)?;
    arm.write(EFFECTOR_TYPE.address, &[effector::GRIPPER])?;
    arm.write(GRIP_LIMIT.address, &[limit])?;
    arm.plant().set_thing(Some(thing));
    arm.write(SPEED.of(CLAW), &[10])?;
    arm.write(TARGET_POSITION.of(CLAW), &[TARGET])?;
    let begun = arm.now();
    let mut peak = 0;
    while arm.now() - begun < Duration::from_millis(SETTLED_S * 1_000) {
        arm.step()?;
        peak = peak.max(push(&mut arm));
    }
    let settled = push(&mut arm);
    let rest = begun + time - arm.now();
    arm.run(rest)?;
    let last = push(&mut arm);
    let (heat, alarms) = (arm.read(SERVO_TEMPERATURE.address)?, arm.read(SERVO_ALARMS.address)?);
    Ok(format!("{} | {} | {} | {heat} °C | {alarms}", percent(peak), percent(settled), percent(last)))
}

fn push(arm: &mut impl ObstacleArm) -> u16 {
    arm.plant().load(CLAW).unsigned_abs()
}
