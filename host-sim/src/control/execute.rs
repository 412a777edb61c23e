//! Executes the requests of a control socket on an arm.

use arm_sim::controller::ArmController;
use arm_sim::faults::{ArmFault, FaultLocation};
use arm_sim::plant::HEAVIEST_LOAD_G;
use arm_sim::plant::Plant;
use embedded_storage::nor_flash::NorFlash;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};
use serde_json::{Value, json};

use super::request::{Grip, HandAction, Power, Refusal, Request};
use super::state;
use crate::pty_arm::PtyArm;

/// The longest duration of a fault, in milliseconds: a day.
const LONGEST_MS: u64 = 86_400_000;

/// Executes a request at `now`.
///
/// # Errors
/// A value in the request is wrong, or the arm is in the wrong state.
pub fn execute<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    request: Request,
) -> Result<Value, Refusal> {
    match request {
        Request::Fault { fault, for_ms } => begin_fault(arm, now, &fault, for_ms),
        Request::Clear { at } => end_faults(arm, now, at.as_deref()),
        Request::Faults => Ok(json!({
            "faults": state::reports(&arm.simulation_mut().faults(), now),
            "ended_faults": state::reports(arm.ended_faults(), now),
        })),
        Request::Hand { joint, to } => hand(arm, now, joint, to),
        Request::Weight { grams } => weight(arm, now, grams),
        Request::Power { to } => power(arm, now, to),
        Request::Restart => {
            let running = needs_power(arm)?;
            running.restart_controller(now);
            Ok(json!({}))
        }
        Request::Halt => {
            let running = needs_power(arm)?;
            running.simulation_mut().halt_controller(now);
            Ok(json!({}))
        }
        Request::State => Ok(state::of(arm, now)),
    }
}

fn begin_fault<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    fault: &str,
    for_ms: Option<u64>,
) -> Result<Value, Refusal> {
    const HINT: &str = "FAULTS in host-sim --help lists the faults";
    let fault: ArmFault = fault.parse().map_err(|error| Refusal::new(error, HINT))?;
    if for_ms.is_some_and(|millis| !(1..=LONGEST_MS).contains(&millis)) {
        return Err(Refusal::new(
            "for_ms is not from 1 to 86400000",
            "a fault without a time stays until it is cleared",
        ));
    }
    let replaced = arm.simulation_mut().set_fault(now, fault, for_ms.map(Duration::from_millis));
    Ok(json!({ "fault": fault.to_string(), "replaced": state::reports(replaced.as_slice(), now) }))
}

fn end_faults<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    at: Option<&str>,
) -> Result<Value, Refusal> {
    let location: Result<Option<FaultLocation>, _> = at.map(str::parse).transpose();
    let location =
        location.map_err(|error| Refusal::new(error, "{\"do\":\"clear\"} takes all faults back"))?;
    let ended = arm.simulation_mut().end_faults(now, location);
    if ended.is_empty() {
        return Err(Refusal::new("there is no such fault", "{\"do\":\"faults\"} lists the faults"));
    }
    Ok(json!({ "ended": state::reports(&ended, now) }))
}

fn hand<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    joint: u8,
    to: HandAction,
) -> Result<Value, Refusal> {
    let joint = Joint::new(joint).ok_or_else(|| Refusal::new("no such joint", "joints are 1 to 7"))?;
    let simulation = arm.simulation_mut();
    simulation.advance(now, false);
    let plant = simulation.plant_mut();
    let has_torque = plant.has_torque(joint);
    match to {
        HandAction::Degrees(degrees) => plant.move_by_hand(joint, counts(joint, degrees)?),
        HandAction::Grip(Grip::LetGo) => plant.let_go(joint),
        HandAction::Grip(Grip::Hold) if has_torque => {
            return Err(Refusal::new(
                "the joint has torque, which is stronger than a hand",
                "switch the motors off (motor state 2), or use the fault JOINT=stuck",
            ));
        }
        HandAction::Grip(Grip::Hold) => plant.hold(joint),
    }
    Ok(json!({ "has_torque": has_torque, "angle_degrees": f64::from(plant.angle(joint)) / 1_000.0 }))
}

/// The position of a joint's servo in counts.
fn counts(joint: Joint, degrees: f64) -> Result<u16, Refusal> {
    if !(0.0..=180.0).contains(&degrees) {
        return Err(Refusal::new(
            "the angle is not from 0 to 180 degrees",
            "an angle, \"hold\" or \"let-go\"",
        ));
    }
    #[expect(clippy::cast_possible_truncation, reason = "0 to 180")]
    let angle = MicroDegrees::nearest(degrees as f32);
    Ok(counts_from_angle(joint, angle, 0))
}

fn weight<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    grams: u16,
) -> Result<Value, Refusal> {
    if grams > HEAVIEST_LOAD_G {
        return Err(Refusal::new("the weight is not from 0 to 1000 grams", "0 takes the weight away"));
    }
    let simulation = arm.simulation_mut();
    simulation.advance(now, false);
    simulation.plant_mut().set_load(grams);
    Ok(json!({ "grams": grams }))
}

fn power<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    to: Power,
) -> Result<Value, Refusal> {
    match (to, arm.simulation_mut().has_power()) {
        (Power::Off, _) => arm.simulation_mut().power_off(now),
        (Power::On, true) => {
            return Err(Refusal::new(
                "the power is on",
                "{\"do\":\"power\",\"to\":\"cycle\"} switches it off and on",
            ));
        }
        (Power::On, false) | (Power::Cycle, _) => arm.power_cycle(now),
    }
    Ok(json!({}))
}

/// Refuses if the arm has no power.
fn needs_power<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
) -> Result<&mut PtyArm<F, Plant, C>, Refusal> {
    if arm.simulation_mut().has_power() {
        Ok(arm)
    } else {
        Err(Refusal::new("the arm has no power", "switch it on first: {\"do\":\"power\",\"to\":\"on\"}"))
    }
}
