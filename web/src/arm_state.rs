//! The state of an arm, decoded from its registers to physical units.

use kinematics::geometry::{LINKAGE_MAX, LINKAGE_MIN};
use kinematics::{forward, limits};
use sevenbot::cartesian::{Breach, FixedObstacle, Guard, JointPath};
use sevenbot::map::{
    FAULTS, FINE_POSITION, FINE_TARGET, LOAD, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION,
    SERVO_TEMPERATURE, SPEED, SUPPLY_VOLTAGE, TARGET_POSITION, TIME, VELOCITY, motor_state,
};
use sevenbot::{FineAngle, Health, Joint, MoveTime, Problem, ProblemKind, Snapshot, Speed};

/// A joint at rest is stalled if its distance from its target is larger than this, in degrees. The load on a working servo causes
/// a smaller distance.
const STALLED_DISTANCE: f32 = 3.0;
/// Tolerance for the limits of the linkage, in degrees: an arm at a limit may measure this much beyond it.
const LINKAGE_PLAY: f64 = 1.0;
/// A joint that is slower than this is at rest, in degrees per second.
const RESTING_VELOCITY: f32 = 1.0;

/// An arm at one instant, joint 1 first.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmState {
    /// The present positions in degrees. A silent joint keeps its last one. A joint not measured since power-up has `None`, or 0 on
    /// an arm without the extended block.
    pub measured: [Option<f32>; 7],
    /// The target positions in degrees.
    pub targets: [f32; 7],
    /// The velocities in degrees per second, positive towards greater angles. 0 from an arm without the extended block.
    pub velocities: [f32; 7],
    /// The loads in percent of the stall torque, positive towards greater angles. 0 from an arm without the extended block.
    pub loads: [f32; 7],
    /// Register 29: 0 damping, 1 servo, 2 forceless.
    pub motor_state: u8,
    /// Register 241: the fault bits. 0 from an arm without the status block.
    pub faults: u8,
    /// Register 242: the joints whose servos do not answer, bit n-1 for joint n.
    pub missing: u8,
    /// Register 243: the joints whose set-point has not reached its target, bit n-1 for joint n.
    pub moving: u8,
    /// The stalled joints, bit n-1 for joint n: the joints that the arm reports as blocked or let go, and those of joints 1 to 6
    /// that rest away from their target. Joint 7 may rest away from its target because it holds something. 0 if the motors are
    /// off or damped, or from an arm that lacks the extended or the status block.
    pub stalled: u8,
    /// The problems that need attention, the most important first.
    pub problems: Vec<Problem>,
    /// The supply of the servos in volts; `None` while unknown.
    pub volts: Option<f32>,
    /// The temperature of the hottest servo, in degrees Celsius; `None` while unknown.
    pub celsius: Option<u8>,
}

impl ArmState {
    /// Decodes registers 0 to 255.
    #[must_use]
    pub fn new(registers: &Snapshot) -> Self {
        let is_fine = registers.has_extended_block();
        let whole = |row| registers.joints(row).map(f32::from);
        let hundredths = |word| f32::from(word) / 100.0;
        let tenths = |row| registers.words(row).map(|word| f32::from(word.cast_signed()) / 10.0);
        let measured = if is_fine {
            let angle = |word| FineAngle::from_hundredths(word).map(|angle| hundredths(angle.hundredths()));
            registers.words(&FINE_POSITION).map(angle)
        } else {
            whole(&PRESENT_POSITION).map(Some)
        };
        let targets =
            if is_fine { registers.words(&FINE_TARGET).map(hundredths) } else { whole(&TARGET_POSITION) };
        let [velocities, loads] = [&VELOCITY, &LOAD].map(|row| if is_fine { tenths(row) } else { [0.0; 7] });
        let has_status = registers.has_status_block();
        let status = |row| if has_status { registers.byte(row) } else { 0 };
        let known = |value: u8| (value != 0).then_some(value);
        let mut state = Self {
            measured,
            targets,
            velocities,
            loads,
            motor_state: registers.byte(&MOTOR_STATE),
            faults: status(&FAULTS),
            missing: status(&MISSING_SERVOS),
            moving: status(&MOVING_JOINTS),
            stalled: 0,
            problems: Health::new(registers).problems(),
            volts: known(status(&SUPPLY_VOLTAGE)).map(|decivolts| f32::from(decivolts) / 10.0),
            celsius: known(status(&SERVO_TEMPERATURE)),
        };
        if is_fine && has_status && state.motor_state == motor_state::SERVO {
            state.stalled = state.reported_stalled() | state.resting_away();
        }
        state
    }

    fn reported_stalled(&self) -> u8 {
        let is_stalled =
            |problem: &&Problem| matches!(problem.kind, ProblemKind::Blocked | ProblemKind::LetGo);
        let joints = self.problems.iter().filter(is_stalled).filter_map(|problem| problem.joint);
        joints.fold(0, |bits, joint| bits | joint.bit())
    }

    fn resting_away(&self) -> u8 {
        let joints = (0..6).zip(self.measured).zip(self.targets).zip(self.velocities);
        let stalled = joints.filter(|(((index, measured), target), velocity)| {
            let distance = measured.map_or(0.0, |measured| (measured - target).abs());
            let is_sent = self.moving >> index & 1 == 1;
            !is_sent && distance > STALLED_DISTANCE && velocity.abs() < RESTING_VELOCITY
        });
        stalled.fold(0, |bits, (((index, _), _), _)| bits | 1 << index)
    }

    /// The measured angles in degrees; `None` for a joint that was not measured or whose servo does not answer now: its registers
    /// keep the last angle.
    #[must_use]
    pub fn answered(&self) -> [Option<f32>; 7] {
        let mut angles = self.measured;
        for (angle, index) in angles.iter_mut().zip(0..) {
            *angle = angle.filter(|_| self.missing >> index & 1 == 0);
        }
        angles
    }

    /// The tip: x, y, z in mm; `None` if one of joints 1 to 6 was not measured or its servo does not answer.
    #[must_use]
    pub fn tip(&self) -> Option<[f64; 3]> {
        self.answered().iter().take(6).all(Option::is_some).then(|| tip(self.angles()))
    }

    /// The measured angle of each joint, or its target if it was not measured, in degrees.
    #[must_use]
    pub fn angles(&self) -> [f32; 7] {
        let mut angles = self.targets;
        for (angle, measured) in angles.iter_mut().zip(self.measured) {
            *angle = measured.unwrap_or(*angle);
        }
        angles
    }
}

/// The position of the tip at these angles in degrees: x, y, z in mm.
#[must_use]
pub fn tip(angles: [f32; 7]) -> [f64; 3] {
    let [t1, t2, t3, t4, t5, t6, _] = angles.map(f64::from);
    let tip = forward([t1, t2, t3, t4, t5, t6]).hand.tip;
    [tip.x, tip.y, tip.z]
}

/// Checks the path of the joints to these angles in degrees, at the speeds and times of the registers, against the guard of the
/// workspace. Returns the first breach; `None` if the guard allows the path.
#[must_use]
pub fn breach_on_way(registers: &Snapshot, to: [f32; 7]) -> Option<Breach> {
    let [from, to] = [ArmState::new(registers).angles(), to].map(first_five);
    let (mut speeds, mut times) = ([Speed::MAXIMUM; 5], [MoveTime::NONE; 5]);
    for ((speed, time), joint) in speeds.iter_mut().zip(&mut times).zip(Joint::ALL) {
        *speed = Speed::from_steps(registers.at(SPEED.of(joint))).unwrap_or(*speed);
        *time = MoveTime::from_steps(registers.at(TIME.of(joint))).unwrap_or(*time);
    }
    let path = JointPath::at_pace(from, to, speeds, times);
    Guard::default().check_path(&path).err().map(|on_way| on_way.breach)
}

/// Checks a pose in degrees. Returns the name of a text if a part of the arm is below the table or in the base, or if joints 2
/// and 3 are beyond the limits of their linkage.
#[must_use]
pub fn misplaced(angles: [f32; 7]) -> Option<&'static str> {
    let [_, t2, t3, ..] = angles;
    let is_within = (LINKAGE_MIN - LINKAGE_PLAY..=LINKAGE_MAX + LINKAGE_PLAY)
        .contains(&limits::linkage(f64::from(t2), f64::from(t3)));
    let breach = Guard::default().check_pose(first_five(angles)).err();
    breach.map(|breach| breach_text(&breach)).or((!is_within).then_some("beyond-linkage"))
}

fn first_five(angles: [f32; 7]) -> [f64; 5] {
    let [t1, t2, t3, t4, t5, ..] = angles.map(f64::from);
    [t1, t2, t3, t4, t5]
}

/// The name of the text that describes a breach.
#[must_use]
pub const fn breach_text(breach: &Breach) -> &'static str {
    match breach.obstacle {
        FixedObstacle::Table => "below-table",
        FixedObstacle::Base => "in-base",
    }
}

/// The address and values of the write that sets the target of one joint, 1 to 7, to an angle in degrees. Rounds to whole
/// degrees on an arm without the extended block. `None` if there is no such joint or angle.
#[must_use]
pub fn target_frame(registers: &Snapshot, joint: u8, degrees: f32) -> Option<(u8, Vec<u8>)> {
    let joint = sevenbot::Joint::new(joint)?;
    let angle = FineAngle::from_degrees(degrees.into())?;
    Some(if registers.has_extended_block() {
        (FINE_TARGET.of(joint), angle.hundredths().to_le_bytes().to_vec())
    } else {
        (TARGET_POSITION.of(joint), vec![angle.nearest().degrees()])
    })
}
