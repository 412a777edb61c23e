//! The health of an arm as a diagnosis of ROS, with keys of `ros/sevenbot_ros`.

use sevenbot::Health;
use sevenbot::health::{JointHealth, Problem, sentences};
use sevenbot::register_text::motor_state_name;

use crate::messages::{DiagnosticStatus, KeyValue};

/// The name of the status: the same as of a node `/sevenbot`.
const NAME: &str = "/sevenbot: arm";
const OK: u8 = 0;
const WARN: u8 = 1;
const ERROR: u8 = 2;

/// The diagnosis of the arm at this port.
pub(crate) fn status(health: &Health, port: &str) -> DiagnosticStatus {
    let problems = health.problems();
    DiagnosticStatus {
        level: level(health, &problems),
        name: NAME,
        message: message(health, &problems),
        hardware_id: port.to_owned(),
        values: values(health),
    }
}

fn level(health: &Health, problems: &[Problem]) -> u8 {
    match problems {
        [] if health.is_driven() => OK,
        _ if problems.iter().any(|problem| problem.kind.ends_moves()) => ERROR,
        _ => WARN,
    }
}

fn message(health: &Health, problems: &[Problem]) -> String {
    let state = motor_state_name(health.motor_state);
    let not_driven = (!health.is_driven()).then(|| format!("the motors do not drive: {state}"));
    let problems = (!problems.is_empty()).then(|| sentences(problems));
    let all: Vec<String> = problems.into_iter().chain(not_driven).collect();
    if all.is_empty() { "healthy".to_owned() } else { all.join("; ") }
}

fn values(health: &Health) -> Vec<KeyValue> {
    let joints = |is: fn(&JointHealth) -> Option<bool>| {
        let known = health.joints.iter().any(|joint| is(joint).is_some());
        let named = health.joints.iter().filter(|joint| is(joint) == Some(true));
        let names: Vec<String> = named.map(|joint| format!("joint_{}", joint.joint.number())).collect();
        known.then(|| if names.is_empty() { "none".to_owned() } else { names.join(" ") })
    };
    let rows = [
        ("motors", Some(motor_state_name(health.motor_state).to_owned())),
        ("blocked", joints(|joint| joint.is_blocked)),
        ("let go", joints(|joint| joint.has_let_go)),
        ("missing", joints(|joint| joint.is_silent)),
        ("moving", joints(|joint| joint.is_moving)),
        ("supply lost", health.is_supply_lost.map(|lost| if lost { "True" } else { "False" }.to_owned())),
        ("supply in V", health.supply_volts.map(|volts| format!("{volts:.1}"))),
        ("hottest servo in degrees Celsius", health.hottest_celsius.map(|degrees| degrees.to_string())),
        ("alarms of the servos", health.alarms.map(|bits| format!("{bits:#04x}"))),
        ("faults of the controller", health.faults.map(|bits| format!("{bits:#04x}"))),
    ];
    rows.into_iter().filter_map(|(key, value)| Some(KeyValue { key, value: value? })).collect()
}
