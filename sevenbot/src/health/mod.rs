//! The health of an arm at one instant: each joint, the servos' alarms, the supply, and what needs attention.
//!
//! ```text
//!   registers 29 to 60, 128 to 255 ──▶ Health ──▶ problems ──▶ words and remedies (problem.rs)
//!   the same during a move ──▶ MoveWatch, MoveCheck ──▶ the reason to end it
//! ```
//!
//! A value that the firmware does not report is `None`, not 0 or `false`.

mod check;
mod joint;
mod problem;
mod watch;

use protocol_core::registers::map::{
    BLOCKED_JOINTS, EFFECTOR_TYPE, FAULTS, FINE_TARGET, LET_GO_JOINTS, MISSING_SERVOS, MOTOR_STATE,
    PROTECTION, SERVO_ALARMS, SERVO_TEMPERATURE, SUPPLY_LOST, SUPPLY_VOLTAGE, effector, fault, motor_state,
};
use protocol_core::registers::{JOINTS, Joint};

use crate::arm::Arm;
use crate::error::Error;
use crate::identity::Firmware;
use crate::joints::JointSnapshot;
use host_link::{Snapshot, Span};

pub use check::{MoveCheck, MoveCheckError, MoveState};
use joint::CLAW;
pub use joint::JointHealth;
pub(crate) use problem::{ALARM_BITS, FAULT_BITS};
pub use problem::{Problem, ProblemKind, remedies, sentences};
pub use watch::{MoveFault, MoveWatch};

const ALL_JOINTS: u8 = (1 << JOINTS) - 1;

/// The health of an arm. A value is `None` where the firmware does not tell it.
///
/// ```
/// use sevenbot::simulated::{self, SimulationConfig};
/// use std::time::Duration;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let (mut arm, simulation) = simulated::arm(SimulationConfig::default())?;
/// arm.sleep(Duration::from_secs(1));
/// assert!(arm.health()?.problems().is_empty());
/// simulation.with(|simulation| {
///     simulation.plant_mut().set_fault(sevenbot::Joint::ALL[2], "missing".parse().ok());
/// });
/// arm.sleep(Duration::from_secs(1));
/// let problems = arm.health()?.problems();
/// assert_eq!(problems[0].to_string(), "joint 3 does not answer: its position is unknown");
/// println!("{}", problems[0].kind.remedy());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Health {
    /// Register 29, see [`motor_state`].
    pub motor_state: u8,
    /// The joints, joint 1 first.
    pub joints: [JointHealth; JOINTS],
    /// The bits of [`fault`].
    pub faults: Option<u8>,
    /// The bits of [`crate::map::servo_alarm`], of all servos together.
    pub alarms: Option<u8>,
    /// Did the controller switch the motors off because the servos lost their supply
    /// ([D29](protocol_core::decisions#d29))?
    pub is_supply_lost: Option<bool>,
    /// Is the protection on? Then a joint that pushes too hard gives way, and a servo that let go engages anew
    /// ([D27](protocol_core::decisions#d27), [D28](protocol_core::decisions#d28)).
    pub is_protected: Option<bool>,
    /// The supply voltage of the servos; `None` also if no servo has reported it.
    pub supply_volts: Option<f64>,
    /// The temperature of the hottest servo in degrees Celsius; `None` also if no servo has reported it. No register tells
    /// which servo it is.
    pub hottest_celsius: Option<u8>,
    flags: ProblemFlags,
}

impl Arm {
    /// The health of the arm, from two reads. Other firmware than this project's needs one read, and most values are `None`.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn health(&mut self) -> Result<Health, Error> {
        let joints = self.read_span(JointSnapshot::REGISTERS)?;
        Ok(Health::new(&self.with_blocks(&joints)?))
    }

    /// Registers 0 to 255: the values of `joints`, and this project's blocks, read now, if the firmware has them. All others are
    /// 0.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn with_blocks(&mut self, joints: &Snapshot) -> Result<Snapshot, Error> {
        let mut registers = Snapshot { address: 0, values: vec![0; 256] };
        registers.put(joints);
        if self.identity().firmware() == Firmware::Ours {
            registers.put(&self.read_span(Span::between(&FINE_TARGET, &SERVO_TEMPERATURE))?);
        }
        Ok(registers)
    }
}

impl Health {
    /// From registers 0 to 255, with 0 in the registers of each block that the firmware lacks.
    #[must_use]
    pub fn new(registers: &Snapshot) -> Self {
        let has_status = registers.has_status_block();
        let known = |row| has_status.then(|| registers.byte(row)).filter(|&value| value != 0);
        let guarded = |row| registers.has_protection_block().then(|| registers.byte(row));
        Self {
            motor_state: registers.byte(&MOTOR_STATE),
            joints: Joint::ALL.map(|joint| JointHealth::new(joint, registers)),
            faults: has_status.then(|| registers.byte(&FAULTS)),
            alarms: guarded(&SERVO_ALARMS),
            is_supply_lost: guarded(&SUPPLY_LOST).map(|lost| lost != 0),
            is_protected: guarded(&PROTECTION).map(|on| on != 0),
            supply_volts: known(&SUPPLY_VOLTAGE).map(|tenths| f64::from(tenths) / 10.0),
            hottest_celsius: known(&SERVO_TEMPERATURE),
            flags: ProblemFlags::of(registers, registers.byte(&EFFECTOR_TYPE) == effector::GRIPPER),
        }
    }

    /// Do the motors drive the joints?
    #[must_use]
    pub const fn is_driven(&self) -> bool {
        self.motor_state == motor_state::SERVO
    }

    /// The joints among `joints` ([`Joint::bit`]s) that are not at their targets, each with its position and target in degrees.
    /// Joints without a position are left out, and so is a gripper that holds something.
    #[must_use]
    pub fn away_from_targets(&self, joints: u8) -> Vec<(Joint, u8, u8)> {
        let ours = self.joints.iter().filter(|joint| joints & joint.joint.bit() != 0);
        let away = ours.filter(|joint| !joint.is_at_target && joint.is_gripping != Some(true));
        let degrees = |joint: &JointHealth| {
            Some((joint.joint, joint.position?.nearest().degrees(), joint.target.nearest().degrees()))
        };
        away.filter_map(degrees).collect()
    }

    /// What needs attention, the most important first. Empty if nothing that the firmware tells is wrong.
    #[must_use]
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = self.servo_problems();
        let explained = problems.iter().any(|problem| problem.kind != ProblemKind::Blocked);
        let faults = self.faults.unwrap_or(0);
        let faults = FAULT_BITS.into_iter().filter(|(bit, _)| faults & bit != 0);
        // Silent servos and alarms also set the bit of the servo bus. They are reported as problems of their own, which say
        // more.
        let told = faults.filter(|(bit, _)| *bit != fault::SERVO_BUS || !explained);
        problems.extend(told.map(|(_, kind)| Problem::of_arm(kind)));
        problems.sort_unstable();
        problems
    }

    fn servo_problems(&self) -> Vec<Problem> {
        let mut problems = self.flags.problems(ALL_JOINTS);
        let alarms = self.alarms.unwrap_or(0);
        let set = ALARM_BITS.into_iter().filter(|(bit, _)| alarms & bit != 0);
        problems.extend(set.map(|(_, kind)| Problem::of_arm(kind)));
        problems
    }
}

/// The problems that registers 195 to 242 tell. Joints are [`Joint::bit`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct ProblemFlags {
    silent: u8,
    let_go: u8,
    blocked: u8,
    is_gripping: bool,
    is_supply_lost: bool,
}

impl ProblemFlags {
    /// From registers 195 to 242; 0 where the firmware does not tell. `is_gripper`: does register 30 select the gripper?
    fn of(registers: &Snapshot, is_gripper: bool) -> Self {
        let guarded = |row| if registers.has_protection_block() { registers.byte(row) } else { 0 };
        let grips = CLAW.filter(|_| is_gripper).map_or(0, Joint::bit);
        let blocked = guarded(&BLOCKED_JOINTS);
        Self {
            silent: if registers.has_status_block() { registers.byte(&MISSING_SERVOS) } else { 0 },
            let_go: guarded(&LET_GO_JOINTS),
            blocked: blocked & !grips,
            is_gripping: blocked & grips != 0,
            is_supply_lost: guarded(&SUPPLY_LOST) != 0,
        }
    }

    /// The problems of these joints, and those of the whole arm.
    fn problems(self, joints: u8) -> Vec<Problem> {
        let supply = self.is_supply_lost.then_some(Problem::of_arm(ProblemKind::SupplyLost));
        if self.silent == ALL_JOINTS {
            return supply.into_iter().chain([Problem::of_arm(ProblemKind::NoServoAnswers)]).collect();
        }
        let rows = [
            (ProblemKind::NoAnswer, self.silent),
            (ProblemKind::LetGo, self.let_go & !self.silent),
            (ProblemKind::Blocked, self.blocked & !self.silent & !self.let_go),
        ];
        let of_joints = rows.into_iter().flat_map(|(kind, bits)| Problem::of_joints(kind, bits & joints));
        supply.into_iter().chain(of_joints).collect()
    }
}

#[cfg(test)]
pub(crate) mod tests;
