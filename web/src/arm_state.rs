//! What the registers say of an arm, in units.

use kinematics::geometry::{LINKAGE_MAX, LINKAGE_MIN};
use kinematics::{forward, limits};
use sevenbot::cartesian::{Breach, Guard, JointPath, Obstacle};
use sevenbot::map::{
    FAULTS, FINE_POSITION, FINE_TARGET, LOAD, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION,
    SERVO_TEMPERATURE, SPEED, SUPPLY_VOLTAGE, TARGET_POSITION, TIME, VELOCITY, motor_state,
};
use sevenbot::{FineAngle, Health, Joint, MoveTime, Problem, ProblemKind, Snapshot, Speed};

/// A joint is stalled at more than this distance from its target, in degrees. Under its load a servo that works is nearer.
const STALLED_DISTANCE: f32 = 3.0;
/// An arm at the end of its linkage is measured this far beyond it, in degrees.
const LINKAGE_PLAY: f64 = 1.0;
/// A joint below this velocity rests, in degrees per second.
const RESTING_VELOCITY: f32 = 1.0;

/// An arm at one instant, joint 1 first.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmState {
    /// In degrees; `None` for a joint that was not measured since power-up.
    pub measured: [Option<f32>; 7],
    /// In degrees.
    pub targets: [f32; 7],
    /// In degrees per second, positive towards greater angles. 0 from an arm without the extended block.
    pub velocities: [f32; 7],
    /// In percent of the stall torque, positive towards greater angles. 0 from an arm without the extended block.
    pub loads: [f32; 7],
    /// Register 29: 0 damping, 1 servo, 2 forceless.
    pub motor_state: u8,
    /// Register 241.
    pub faults: u8,
    /// Bit n-1 for joint n, as in `moving`.
    pub missing: u8,
    /// Joints whose set-point moves.
    pub moving: u8,
    /// Joints that something holds, or whose servo gives no force: those that the arm reports, and those of 1 to 6 that rest away
    /// from their target. A gripper that holds something rests away from its target, too. 0 from an arm without the extended
    /// block.
    pub stalled: u8,
    /// What needs attention, the most important first.
    pub problems: Vec<Problem>,
    /// In volts; `None` while unknown.
    pub volts: Option<f32>,
    /// Of the hottest servo, in degrees Celsius; `None` while unknown.
    pub celsius: Option<u8>,
}

impl ArmState {
    /// From registers 0 to 255.
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

    /// The angles of joints whose servos answer. A silent servo leaves its last angle in the registers.
    #[must_use]
    pub fn answered(&self) -> [Option<f32>; 7] {
        let mut angles = self.measured;
        for (angle, index) in angles.iter_mut().zip(0..) {
            *angle = angle.filter(|_| self.missing >> index & 1 == 0);
        }
        angles
    }

    /// The tip: x, y, z in mm; `None` if the servo of one of joints 1 to 6 does not answer.
    #[must_use]
    pub fn tip(&self) -> Option<[f64; 3]> {
        self.answered().iter().take(6).all(Option::is_some).then(|| tip(self.angles()))
    }

    /// The measured angles, and the targets of joints that were not measured.
    #[must_use]
    pub fn angles(&self) -> [f32; 7] {
        let mut angles = self.targets;
        for (angle, measured) in angles.iter_mut().zip(self.measured) {
            *angle = measured.unwrap_or(*angle);
        }
        angles
    }
}

/// The tip at these angles: x, y, z in mm.
#[must_use]
pub fn tip(angles: [f32; 7]) -> [f64; 3] {
    let [t1, t2, t3, t4, t5, t6, _] = angles.map(f64::from);
    let tip = forward([t1, t2, t3, t4, t5, t6]).hand.tip;
    [tip.x, tip.y, tip.z]
}

/// Where the guard of the workspace does not allow the way of the joints to these angles, at the speeds of the registers.
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

/// The name of the text that says where a part of the arm must not be at these angles, and is: below the table, in the base, or
/// beyond the linkage.
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

/// The name of the text that says what a breach is.
#[must_use]
pub const fn breach_text(breach: &Breach) -> &'static str {
    match breach.obstacle {
        Obstacle::Table => "below-table",
        Obstacle::Base => "in-base",
    }
}

/// The frame that sends one joint, 1 to 7, to an angle in degrees. `None` if there is no such joint or angle.
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
