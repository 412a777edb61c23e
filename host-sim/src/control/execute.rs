//! Executes the requests of a control socket on an arm.

use arm_sim::action::Action;
use arm_sim::controller::ArmController;
use arm_sim::faults::{ArmFault, FaultLocation};
use arm_sim::plant::HEAVIEST_LOAD_G;
use arm_sim::plant::Plant;
use arm_sim::servo::Trip;
use embedded_storage::nor_flash::NorFlash;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};
use serde_json::{Value, json};

use super::request::{Alarm, Grip, HandAction, Power, Refusal, Request, SpeedFactor};
use super::state;
use crate::pty_arm::PtyArm;
use crate::virtual_clock::{Speed, VirtualClock};

/// The longest duration of a fault or of an advance, in milliseconds: a day.
const LONGEST_MS: u64 = 86_400_000;

/// How a request ends.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// With this result.
    Done(Value),
    /// At this virtual time.
    At(Instant),
}

/// Executes a request.
///
/// # Errors
/// A value in the request is wrong, or the arm is in the wrong state.
pub fn execute<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    clock: &mut VirtualClock,
    request: Request,
) -> Result<Outcome, Refusal> {
    const HINT: &str = "without --lockstep, virtual time can be paused and has a speed";
    let follows = |error| Refusal::new(error, HINT);
    let done = match request {
        Request::Pause => clock.pause(true).map(|()| time(clock)).map_err(follows),
        Request::Resume => clock.pause(false).map(|()| time(clock)).map_err(follows),
        Request::Speed { factor } => clock.set_speed(speed(factor)?).map(|()| time(clock)).map_err(follows),
        Request::Advance { ms } if (1..=LONGEST_MS).contains(&ms) => {
            return Ok(Outcome::At(clock.advance(Duration::from_millis(ms))));
        }
        Request::Advance { .. } => Err(Refusal::new(
            "the time is not from 1 to 86400000 ms",
            "use several requests for more than a day",
        )),
        Request::Snapshot { name } => snapshot(arm, clock, name),
        Request::Restore { name } => restore(arm, clock, &name),
        Request::State => Ok(with_speed(state::of(arm, clock.now()), clock)),
        request => change(arm, clock.now(), request),
    };
    done.map(Outcome::Done)
}

fn speed(factor: SpeedFactor) -> Result<Speed, Refusal> {
    let speed = match factor {
        SpeedFactor::Max(_) => Some(Speed::Max),
        SpeedFactor::Times(factor) => Speed::times(factor),
    };
    speed.ok_or_else(|| {
        Refusal::new("the speed is not from 0.001 to 1000", "1 is real time, and max is the fastest")
    })
}

/// Time and speed.
fn time(clock: &VirtualClock) -> Value {
    with_speed(json!({ "time_us": clock.now().as_micros() }), clock)
}

/// Adds the speed of virtual time.
fn with_speed(mut value: Value, clock: &VirtualClock) -> Value {
    let speed = match clock.speed() {
        _ if clock.is_in_lockstep() => json!("lockstep"),
        None => json!("paused"),
        Some(Speed::Max) => json!("max"),
        Some(Speed::Thousandths(factor)) => json!(f64::from(factor) / 1_000.0),
    };
    if let Some(object) = value.as_object_mut() {
        object.insert("speed".to_owned(), speed);
    }
    value
}

fn snapshot<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    clock: &VirtualClock,
    name: String,
) -> Result<Value, Refusal> {
    can_go_back(arm, clock)?;
    let answer = json!({ "snapshot": name, "time_us": clock.now().as_micros() });
    arm.keep_snapshot(name).map_err(|error| Refusal::new(&error, error.hint()))?;
    Ok(answer)
}

fn restore<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    clock: &mut VirtualClock,
    name: &str,
) -> Result<Value, Refusal> {
    can_go_back(arm, clock)?;
    clock.set_now(arm.restore_snapshot(name).map_err(|error| Refusal::new(&error, error.hint()))?);
    Ok(json!({ "snapshot": name, "time_us": clock.now().as_micros() }))
}

/// Refuses if virtual time cannot go back.
fn can_go_back<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    clock: &VirtualClock,
) -> Result<(), Refusal> {
    if clock.is_shared() {
        return Err(Refusal::new(
            "several arms have the same virtual time, because host-sim runs with --arms",
            "only a simulator of one arm has snapshots",
        ));
    }
    if arm.simulation_mut().is_recorded() {
        return Err(Refusal::new(
            "a recorded session cannot go back in time",
            "only host-sim without --record has snapshots",
        ));
    }
    Ok(())
}

/// Executes a request that changes the arm, or lists its faults, at `now`.
fn change<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    request: Request,
) -> Result<Value, Refusal> {
    match request {
        Request::Fault { fault, for_ms } => begin_fault(arm, now, &fault, for_ms),
        Request::Clear { at } => end_faults(arm, now, at.as_deref()),
        Request::Hand { joint, to } => hand(arm, now, joint, to),
        Request::Weight { grams } => weight(arm, now, grams),
        Request::Drop => {
            let ended = arm.act(now, Action::Drop);
            Ok(json!({ "ended": state::reports(&ended, now) }))
        }
        Request::Trip { joint, alarm } => trip(arm, now, joint, alarm),
        Request::Power { to } => power(arm, now, to),
        Request::Restart => {
            needs_power(arm).map(|arm| arm.act(now, Action::RestartController)).map(|_| json!({}))
        }
        Request::Halt => needs_power(arm).map(|arm| arm.act(now, Action::HaltController)).map(|_| json!({})),
        _ => Ok(json!({
            "faults": state::reports(&arm.simulation_mut().faults(), now),
            "ended_faults": state::reports(arm.ended_faults(), now),
        })),
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
    let replaced = arm.act(now, Action::Fault(fault, for_ms.map(Duration::from_millis)));
    Ok(json!({ "fault": fault.to_string(), "replaced": state::reports(&replaced, now) }))
}

fn end_faults<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    at: Option<&str>,
) -> Result<Value, Refusal> {
    let location: Result<Option<FaultLocation>, _> = at.map(str::parse).transpose();
    let location =
        location.map_err(|error| Refusal::new(error, "{\"do\":\"clear\"} takes all faults back"))?;
    let ended = arm.act(now, Action::Clear(location));
    if ended.is_empty() {
        return Err(Refusal::new("there is no such fault", "{\"do\":\"faults\"} lists the faults"));
    }
    Ok(json!({ "ended": state::reports(&ended, now) }))
}

fn numbered(joint: u8) -> Result<Joint, Refusal> {
    Joint::new(joint).ok_or_else(|| Refusal::new("no such joint", "joints are 1 to 7"))
}

fn hand<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    joint: u8,
    to: HandAction,
) -> Result<Value, Refusal> {
    let joint = numbered(joint)?;
    let has_torque = arm.simulation_mut().plant().has_torque(joint);
    let action = match to {
        HandAction::Degrees(degrees) => Action::Hand(joint, counts(joint, degrees)?),
        HandAction::Grip(Grip::LetGo) => Action::LetGo(joint),
        HandAction::Grip(Grip::Hold) if has_torque => {
            return Err(Refusal::new(
                "the joint has torque, which is stronger than a hand",
                "switch the motors off (motor state 2), or use the fault JOINT=stuck",
            ));
        }
        HandAction::Grip(Grip::Hold) => Action::Hold(joint),
    };
    arm.act(now, action);
    let plant = arm.simulation_mut().plant();
    Ok(json!({ "has_torque": has_torque, "angle_degrees": f64::from(plant.angle(joint)) / 1_000.0 }))
}

fn trip<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    joint: u8,
    alarm: Alarm,
) -> Result<Value, Refusal> {
    let joint = numbered(joint)?;
    let trip = match alarm {
        Alarm::Overload if !arm.simulation_mut().plant().has_torque(joint) => {
            return Err(Refusal::new(
                "the joint has no torque, so its servo cannot be overloaded",
                "switch the motors on first (motor state 1), or use the alarm heat",
            ));
        }
        Alarm::Overload => Trip::Overload,
        Alarm::Heat => Trip::Heat,
    };
    arm.act(now, Action::Trip(joint, trip));
    Ok(json!({}))
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
    arm.act(now, Action::Weight(grams));
    Ok(json!({ "grams": grams }))
}

fn power<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    now: Instant,
    to: Power,
) -> Result<Value, Refusal> {
    let action = match (to, arm.simulation_mut().has_power()) {
        (Power::Off, _) => Action::PowerOff,
        (Power::On, true) => {
            return Err(Refusal::new(
                "the power is on",
                "{\"do\":\"power\",\"to\":\"cycle\"} switches it off and on",
            ));
        }
        (Power::On, false) | (Power::Cycle, _) => Action::PowerCycle,
    };
    arm.act(now, action);
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
