//! The arm as MJCF for MuJoCo, with the parallelogram as a closed loop.
//!
//! ```text
//!        elbow ●──────────── forearm ──▶
//!     rear_arm ╱  ╲ 40 mm behind it: the end of the rod, held by an equality constraint
//!             ╱ rod ╲
//!   shoulder ●──────● end of the lever
//! ```
//!
//! Joint 2 turns the rear arm and joint 3 the lever, both about the shoulder. The joints of the elbow and the rod are passive.
//! Masses and the values of the servos come from the simulator, [`arm_sim::parameters`].

use std::io;

use arm_sim::Joint;
use arm_sim::parameters::{
    FOREARM_CENTRE_MM, FOREARM_G, FULL_DUTY_ERROR, NO_LOAD_SPEED, REAR_ARM_CENTRE_MM, REAR_ARM_G,
    ServoParameters, TOOL_CENTRE_MM, TOOL_G,
};
use kinematics::geometry::{
    DISC_RADIUS, ELBOW_OFFSET, FOREARM, LEVER, LINKAGE_MAX, LINKAGE_MIN, REAR_ARM, SHOULDER_FORWARD,
    SHOULDER_HEIGHT, TOOL,
};

use crate::ABOUT;
use crate::chain::{
    Axes, BACK, BASE_SOLIDS, DISC_SOLIDS, FOREARM_SOLIDS, HAND_SOLIDS, JOINT_3_HIGH, JOINT_3_LOW, LEFT,
    LinkCylinder, REAR_ARM_SOLIDS, RIGHT, TURRET_SOLIDS, UP, WRIST_SOLIDS, m,
};
use crate::xml::{XmlDocument, number, triple};
use crate::{JOINT_NAMES, TIP};

const QUARTER: [f64; 2] = [-std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2];
const ORIGIN: Axes = [0.0; 3];
/// The end of the lever relative to the shoulder, in metres. The rod ends at the same distance behind the elbow.
const LEVER_END: Axes = [m(-LEVER), 0.0, 0.0];
const RADIUS: f64 = m(4.0);
/// The mass of a body that has none in the simulator, in kilograms. MuJoCo needs one.
const LIGHT: f64 = 0.001;
/// The inertia of a body about its centre, in kilogram square metres. Small, because the simulator has point masses.
const POINT: f64 = 1e-6;

/// The arm in the format of MuJoCo.
///
/// # Errors
/// The text cannot be written. This does not happen in practice, because it is written to memory.
///
/// ```
/// let text = arm_model::mjcf()?;
/// assert!(text.contains("<connect name=\"parallelogram\""));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn mjcf() -> io::Result<String> {
    let mut out = XmlDocument::new();
    out.begin("mujoco", &[text("model", "7bot_v2")])?;
    for line in ABOUT {
        out.comment(line)?;
    }
    out.comment(
        "joint_2 turns the rear arm and joint_3 the lever. The constraint `parallelogram` closes the loop of lever, rod \
         and forearm; elbow = joint_2 + joint_3, and the range of the elbow is the limit of the linkage.",
    )?;
    out.comment(
        "Masses, friction and servos are those of the project's simulator, which assumes most of them. An actuator is a \
         servo's control: kv is its derivative term, so give it the set-point and kv / kp times the set-point's velocity.",
    )?;
    out.empty("compiler", &[text("angle", "radian"), text("autolimits", "true")])?;
    out.empty("option", &[text("integrator", "implicitfast")])?;
    defaults(&mut out)?;
    out.begin("worldbody", &[])?;
    base(&mut out)?;
    out.end()?;
    equality(&mut out)?;
    actuators(&mut out)?;
    out.finish()
}

fn text(name: &'static str, value: &str) -> (&'static str, String) {
    (name, value.to_owned())
}

/// The defaults. Parts of the arm collide with everything but other parts of the arm.
fn defaults(out: &mut XmlDocument) -> io::Result<()> {
    out.begin("default", &[])?;
    // The values of the passive joints. The servo classes override them.
    out.empty("joint", &[text("damping", "0.001"), text("armature", "0.0001")])?;
    out.empty("geom", &[text("contype", "1"), text("conaffinity", "0"), text("type", "cylinder")])?;
    for class in [LARGE, SMALL] {
        out.begin("default", &[text("class", class.name)])?;
        let parameters = ServoParameters::of(class.joint);
        out.empty("joint", &joint_of(parameters))?;
        out.empty("position", &control_of(parameters))?;
        out.end()?;
    }
    out.end()
}

/// A default class of the model, for the joints with the same make of servo.
struct ServoClass {
    name: &'static str,
    /// A joint with a servo of this class.
    joint: Joint,
}

const LARGE: ServoClass = ServoClass { name: "large", joint: Joint::ALL[0] };
const SMALL: ServoClass = ServoClass { name: "small", joint: Joint::ALL[6] };

/// The attribute with the servo class of the joint of this name in the model. `None` for a passive joint.
fn class_of(name: &str) -> Option<(&'static str, String)> {
    let (joint, _) = Joint::ALL.into_iter().zip(JOINT_NAMES).find(|(_, other)| *other == name)?;
    let is_large = ServoParameters::of(joint) == ServoParameters::of(LARGE.joint);
    Some(text("class", if is_large { LARGE.name } else { SMALL.name }))
}

/// Converts micronewton metres to newton metres.
fn millionths(value: i64) -> f64 {
    value as f64 / 1e6
}

/// The stiffness of a servo's control, in newton metres per radian of error.
fn stiffness(servo: &ServoParameters) -> f64 {
    millionths(servo.stall_torque) / thousandths(FULL_DUTY_ERROR).to_radians()
}

fn thousandths(value: i64) -> f64 {
    value as f64 / 1e3
}

/// The attributes of a driven joint. Its damping is the back EMF of the motor.
fn joint_of(servo: &ServoParameters) -> [(&'static str, String); 3] {
    let drag = millionths(servo.stall_torque) / thousandths(NO_LOAD_SPEED).to_radians();
    [
        ("damping", number(drag)),
        // A gram square millimetre is 1e-9 kg m².
        ("armature", number(servo.rotor_inertia as f64 / 1e9)),
        ("frictionloss", number(millionths(servo.sliding_friction))),
    ]
}

fn control_of(servo: &ServoParameters) -> [(&'static str, String); 3] {
    let torque = millionths(servo.stall_torque);
    [
        ("kp", number(stiffness(servo))),
        ("kv", number(stiffness(servo) * thousandths(servo.derivative_ms))),
        ("forcerange", format!("{} {}", number(-torque), number(torque))),
    ]
}

fn base(out: &mut XmlDocument) -> io::Result<()> {
    body(out, "base_link", ORIGIN, BASE_SOLIDS)?;
    body(out, "turret", ORIGIN, TURRET_SOLIDS)?;
    mass(out, LIGHT, ORIGIN)?;
    hinge(out, "joint_1", UP, QUARTER)?;
    let shoulder = [m(SHOULDER_FORWARD), 0.0, m(SHOULDER_HEIGHT)];
    rear_arm(out, shoulder)?;
    lever(out, shoulder)?;
    out.end()?;
    out.end()
}

fn rear_arm(out: &mut XmlDocument, shoulder: Axes) -> io::Result<()> {
    body(out, "rear_arm", shoulder, REAR_ARM_SOLIDS)?;
    mass(out, thousandths(REAR_ARM_G), [0.0, 0.0, thousandths(REAR_ARM_CENTRE_MM)])?;
    hinge(out, "joint_2", RIGHT, QUARTER)?;
    let behind = LinkCylinder { from: ORIGIN, to: LEVER_END, radius: RADIUS };
    let solids = [FOREARM_SOLIDS, &[behind]].concat();
    body(out, "forearm", [0.0, 0.0, m(REAR_ARM)], &solids)?;
    mass(out, thousandths(FOREARM_G), [thousandths(FOREARM_CENTRE_MM), 0.0, m(ELBOW_OFFSET)])?;
    hinge(out, "elbow", LEFT, [LINKAGE_MIN, LINKAGE_MAX].map(|degrees| (degrees - 90.0).to_radians()))?;
    body(out, "wrist", [m(FOREARM), 0.0, m(ELBOW_OFFSET)], WRIST_SOLIDS)?;
    mass(out, LIGHT, ORIGIN)?;
    hinge(out, "joint_4", BACK, QUARTER)?;
    body(out, "hand", ORIGIN, HAND_SOLIDS)?;
    mass(out, thousandths(TOOL_G), [thousandths(TOOL_CENTRE_MM), 0.0, 0.0])?;
    hinge(out, "joint_5", LEFT, QUARTER)?;
    body(out, "disc", [m(TOOL), 0.0, 0.0], DISC_SOLIDS)?;
    mass(out, LIGHT, ORIGIN)?;
    hinge(out, "joint_6", BACK, QUARTER)?;
    out.empty("site", &[text("name", TIP), ("pos", triple(ORIGIN)), text("size", "0.002")])?;
    let edge = [0.0, m(DISC_RADIUS), 0.0];
    out.empty("site", &[text("name", "disc_edge"), ("pos", triple(edge)), text("size", "0.002")])?;
    for _ in ["disc", "hand", "wrist", "forearm", "rear_arm"] {
        out.end()?;
    }
    Ok(())
}

fn lever(out: &mut XmlDocument, shoulder: Axes) -> io::Result<()> {
    body(out, "lever", shoulder, &[LinkCylinder { from: ORIGIN, to: LEVER_END, radius: RADIUS }])?;
    mass(out, LIGHT, ORIGIN)?;
    hinge(out, "joint_3", LEFT, [JOINT_3_LOW, JOINT_3_HIGH])?;
    let rod = LinkCylinder { from: ORIGIN, to: [0.0, 0.0, m(REAR_ARM)], radius: RADIUS };
    body(out, "rod", LEVER_END, &[rod])?;
    mass(out, LIGHT, ORIGIN)?;
    out.empty("joint", &[text("name", "rod_joint"), text("type", "hinge"), ("axis", triple(LEFT))])?;
    out.end()?;
    out.end()
}

/// Begins a body with its shapes.
fn body(out: &mut XmlDocument, name: &str, position: Axes, solids: &[LinkCylinder]) -> io::Result<()> {
    out.begin("body", &[text("name", name), ("pos", triple(position))])?;
    for LinkCylinder { from, to, radius } in solids {
        let ends = format!("{} {}", triple(*from), triple(*to));
        out.empty("geom", &[("fromto", ends), ("size", number(*radius))])?;
    }
    Ok(())
}

/// Writes the mass of the body in kilograms, and its centre.
fn mass(out: &mut XmlDocument, kilograms: f64, centre: Axes) -> io::Result<()> {
    let inertia = ("diaginertia", triple([POINT; 3]));
    out.empty("inertial", &[("mass", number(kilograms)), ("pos", triple(centre)), inertia])
}

/// Writes a joint, with the class of its servo if it is one of joints 1 to 6.
fn hinge(out: &mut XmlDocument, name: &str, axis: Axes, range: [f64; 2]) -> io::Result<()> {
    let range = range.map(number).join(" ");
    let mut words = vec![text("name", name), text("type", "hinge"), ("axis", triple(axis)), ("range", range)];
    words.extend(class_of(name));
    out.empty("joint", &words)
}

fn equality(out: &mut XmlDocument) -> io::Result<()> {
    out.begin("equality", &[])?;
    let anchor = ("anchor", triple([0.0, 0.0, m(REAR_ARM)]));
    out.empty(
        "connect",
        &[text("name", "parallelogram"), text("body1", "rod"), text("body2", "forearm"), anchor],
    )?;
    out.end()
}

fn actuators(out: &mut XmlDocument) -> io::Result<()> {
    out.begin("actuator", &[])?;
    for name in JOINT_NAMES {
        let mut words = vec![text("name", name), text("joint", name), text("inheritrange", "1")];
        words.extend(class_of(name));
        out.empty("position", &words)?;
    }
    out.end()
}
