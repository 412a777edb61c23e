//! Executes the requests of a control socket on an arm.

use arm_sim::action::Action;
use arm_sim::controller::ArmController;
use arm_sim::faults::{ArmFault, FaultLocation};
use arm_sim::plant::{HEAVIEST_LOAD_G, Plant};
use arm_sim::servo::Trip;
use embedded_storage::nor_flash::NorFlash;
use motion_core::calibration::{MicroDegrees, counts_from_angle};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};
use serde_json::{Value, json};

use super::request::{
    self, ControlRefusal, ControlRequest, ForcedAlarm, HandAction, HandGrip, Power, SpeedFactor,
};
use super::socket::ControlReply;
use super::state;
use crate::pty_arm::PtyArm;
use crate::virtual_clock::{TimeSpeed, VirtualClock};

/// The longest duration of a fault or of an advance, in milliseconds: a day.
const LONGEST_MS: u64 = 86_400_000;

/// Executes the request in a line.
pub fn execute<F: NorFlash + Clone, C: ArmController>(
    arm: &mut PtyArm<F, Plant, C>,
    clock: &mut VirtualClock,
    line: &[u8],
) -> ControlReply {
    let answer = match request::parse(line) {
        Ok(ControlRequest::Advance { ms }) if (1..=LONGEST_MS).contains(&ms) => {
            return ControlReply::At(clock.advance(Duration::from_millis(ms)));
        }
        Ok(request) => Executor { arm, clock }.execute(request),
        Err(refusal) => Err(refusal),
    };
    ControlReply::Line(request::line(answer))
}

/// An arm and its clock, on which requests are executed.
struct Executor<'a, F, C> {
    arm: &'a mut PtyArm<F, Plant, C>,
    clock: &'a mut VirtualClock,
}

impl<F: NorFlash + Clone, C: ArmController> Executor<'_, F, C> {
    fn execute(&mut self, request: ControlRequest) -> Result<Value, ControlRefusal> {
        let now = self.now();
        match request {
            ControlRequest::Pause => self.pace(|clock| clock.pause(true)),
            ControlRequest::Resume => self.pace(|clock| clock.pause(false)),
            ControlRequest::Speed { factor } => {
                let speed = speed(factor)?;
                self.pace(|clock| clock.set_speed(speed))
            }
            ControlRequest::Advance { .. } => Err(ControlRefusal::new(
                "the time is not from 1 to 86400000 ms",
                "use several requests for more than a day",
            )),
            ControlRequest::Snapshot { name } => self.snapshot(name),
            ControlRequest::Restore { name } => self.restore(&name),
            ControlRequest::State => Ok(with_speed(state::of(self.arm, now), self.clock)),
            ControlRequest::Fault { fault, for_ms } => self.begin_fault(&fault, for_ms),
            ControlRequest::Clear { at } => self.end_faults(at.as_deref()),
            ControlRequest::Faults => Ok(json!({
                "faults": state::reports(&self.arm.simulation_mut().faults(), now),
                "ended_faults": state::reports(self.arm.ended_faults(), now),
            })),
            ControlRequest::Hand { joint, to } => self.hand(joint, to),
            ControlRequest::Weight { grams } => self.weight(grams),
            ControlRequest::Drop => Ok(json!({ "ended": self.act(Action::Drop) })),
            ControlRequest::Scene { scene } => self.scene(&scene),
            ControlRequest::Trip { joint, alarm } => self.trip(joint, alarm),
            ControlRequest::Power { to } => self.power(to),
            ControlRequest::Restart => self.act_with_power(Action::RestartController),
            ControlRequest::Halt => self.act_with_power(Action::HaltController),
        }
    }

    fn now(&self) -> Instant {
        self.clock.now()
    }

    /// Carries out an action. Returns the reports of the faults that it ended.
    fn act(&mut self, action: Action) -> Vec<Value> {
        let now = self.now();
        state::reports(&self.arm.act(now, action), now)
    }

    /// Carries out an action, or refuses it if the arm has no power.
    fn act_with_power(&mut self, action: Action) -> Result<Value, ControlRefusal> {
        if !self.arm.simulation_mut().has_power() {
            let hint = "`sevenbot sim power on` switches it on";
            return Err(ControlRefusal::new("the arm has no power", hint));
        }
        self.act(action);
        Ok(json!({}))
    }

    /// Changes how virtual time passes. Returns time and speed.
    fn pace<E: ToString>(
        &mut self,
        change: impl FnOnce(&mut VirtualClock) -> Result<(), E>,
    ) -> Result<Value, ControlRefusal> {
        const HINT: &str = "without --lockstep, virtual time can be paused and has a speed";
        change(self.clock).map_err(|error| ControlRefusal::new(error, HINT))?;
        Ok(with_speed(json!({ "time_us": self.now().as_micros() }), self.clock))
    }

    fn snapshot(&mut self, name: String) -> Result<Value, ControlRefusal> {
        self.check_can_go_back()?;
        let answer = json!({ "snapshot": name, "time_us": self.now().as_micros() });
        self.arm.keep_snapshot(name).map_err(|error| ControlRefusal::new(&error, error.hint()))?;
        Ok(answer)
    }

    fn restore(&mut self, name: &str) -> Result<Value, ControlRefusal> {
        self.check_can_go_back()?;
        let restored = self.arm.restore_snapshot(name);
        self.clock.set_now(restored.map_err(|error| ControlRefusal::new(&error, error.hint()))?);
        Ok(json!({ "snapshot": name, "time_us": self.now().as_micros() }))
    }

    /// Refuses if virtual time cannot go back.
    fn check_can_go_back(&mut self) -> Result<(), ControlRefusal> {
        if self.clock.is_shared() {
            return Err(ControlRefusal::new(
                "several arms have the same virtual time, because host-sim runs with --arms",
                "only a simulator of one arm has snapshots",
            ));
        }
        if self.arm.simulation_mut().is_recorded() {
            return Err(ControlRefusal::new(
                "a recorded session cannot go back in time",
                "only host-sim without --record has snapshots",
            ));
        }
        Ok(())
    }

    fn begin_fault(&mut self, fault: &str, for_ms: Option<u64>) -> Result<Value, ControlRefusal> {
        const HINT: &str = "FAULTS in host-sim --help lists the faults";
        let fault: ArmFault = fault.parse().map_err(|error| ControlRefusal::new(error, HINT))?;
        if for_ms.is_some_and(|millis| !(1..=LONGEST_MS).contains(&millis)) {
            return Err(ControlRefusal::new(
                "for_ms is not from 1 to 86400000",
                "a fault without a time stays until it is cleared",
            ));
        }
        let replaced = self.act(Action::Fault(fault, for_ms.map(Duration::from_millis)));
        Ok(json!({ "fault": fault.to_string(), "replaced": replaced }))
    }

    fn end_faults(&mut self, at: Option<&str>) -> Result<Value, ControlRefusal> {
        let location: Result<Option<FaultLocation>, _> = at.map(str::parse).transpose();
        let location = location.map_err(|error| {
            ControlRefusal::new(error, "`sevenbot sim fault clear` takes all faults back")
        })?;
        let ended = self.act(Action::Clear(location));
        if ended.is_empty() {
            return Err(ControlRefusal::new(
                "there is no such fault",
                "`sevenbot sim fault list` lists the faults",
            ));
        }
        Ok(json!({ "ended": ended }))
    }

    fn hand(&mut self, joint: u8, to: HandAction) -> Result<Value, ControlRefusal> {
        let joint = joint_of(joint)?;
        let has_torque = self.arm.simulation_mut().plant().has_torque(joint);
        let action = match to {
            HandAction::Degrees(degrees) => Action::Hand(joint, counts(joint, degrees)?),
            HandAction::Grip(HandGrip::LetGo) => Action::LetGo(joint),
            HandAction::Grip(HandGrip::Hold) if has_torque => {
                return Err(ControlRefusal::new(
                    "the joint has torque, which is stronger than a hand",
                    "switch the motors off (motor state 2), or use the fault JOINT=stuck",
                ));
            }
            HandAction::Grip(HandGrip::Hold) => Action::Hold(joint),
        };
        self.act(action);
        let angle = self.arm.simulation_mut().plant().angle(joint);
        Ok(json!({ "has_torque": has_torque, "angle_degrees": f64::from(angle) / 1_000.0 }))
    }

    fn trip(&mut self, joint: u8, alarm: ForcedAlarm) -> Result<Value, ControlRefusal> {
        let joint = joint_of(joint)?;
        let trip = match alarm {
            ForcedAlarm::Overload if !self.arm.simulation_mut().plant().has_torque(joint) => {
                return Err(ControlRefusal::new(
                    "the joint has no torque, so its servo cannot be overloaded",
                    "switch the motors on first (motor state 1), or use the alarm heat",
                ));
            }
            ForcedAlarm::Overload => Trip::Overload,
            ForcedAlarm::Heat => Trip::Heat,
        };
        self.act(Action::Trip(joint, trip));
        Ok(json!({}))
    }

    fn scene(&mut self, text: &str) -> Result<Value, ControlRefusal> {
        const HINT: &str = "docs/simulation.md describes scenes; off takes the scene away";
        let scene = (text != "off").then(|| text.parse()).transpose();
        let scene = scene.map_err(|error| ControlRefusal::new(error, HINT))?;
        self.act(Action::Scene(scene));
        Ok(json!({ "objects": state::objects(self.arm.simulation_mut().plant()) }))
    }

    fn weight(&mut self, grams: u16) -> Result<Value, ControlRefusal> {
        if grams > HEAVIEST_LOAD_G {
            return Err(ControlRefusal::new(
                "the weight is not from 0 to 1000 grams",
                "0 takes the weight away",
            ));
        }
        self.act(Action::Weight(grams));
        Ok(json!({ "grams": grams }))
    }

    fn power(&mut self, to: Power) -> Result<Value, ControlRefusal> {
        let action = match (to, self.arm.simulation_mut().has_power()) {
            (Power::Off, _) => Action::PowerOff,
            (Power::On, true) => {
                return Err(ControlRefusal::new(
                    "the power is on",
                    "`sevenbot sim power cycle` switches it off and on",
                ));
            }
            (Power::On, false) | (Power::Cycle, _) => Action::PowerCycle,
        };
        self.act(action);
        Ok(json!({}))
    }
}

fn joint_of(number: u8) -> Result<Joint, ControlRefusal> {
    Joint::new(number).ok_or_else(|| ControlRefusal::new("no such joint", "joints are 1 to 7"))
}

/// Converts an angle of a joint from degrees to the position of its servo in counts.
fn counts(joint: Joint, degrees: f64) -> Result<u16, ControlRefusal> {
    if !(0.0..=180.0).contains(&degrees) {
        return Err(ControlRefusal::new(
            "the angle is not from 0 to 180 degrees",
            "an angle, \"hold\" or \"let-go\"",
        ));
    }
    #[expect(clippy::cast_possible_truncation, reason = "0 to 180")]
    let angle = MicroDegrees::nearest(degrees as f32);
    Ok(counts_from_angle(joint, angle, 0))
}

fn speed(factor: SpeedFactor) -> Result<TimeSpeed, ControlRefusal> {
    let speed = match factor {
        SpeedFactor::Max(_) => Some(TimeSpeed::Max),
        SpeedFactor::Times(factor) => TimeSpeed::times(factor),
    };
    speed.ok_or_else(|| {
        ControlRefusal::new("the speed is not from 0.001 to 1000", "1 is real time, and max is the fastest")
    })
}

fn with_speed(mut value: Value, clock: &VirtualClock) -> Value {
    let speed = match clock.speed() {
        _ if clock.is_in_lockstep() => json!("lockstep"),
        None => json!("paused"),
        Some(TimeSpeed::Max) => json!("max"),
        Some(TimeSpeed::Thousandths(factor)) => json!(f64::from(factor) / 1_000.0),
    };
    if let Some(object) = value.as_object_mut() {
        object.insert("speed".to_owned(), speed);
    }
    value
}
