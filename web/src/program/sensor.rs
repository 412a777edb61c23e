//! What the registers tell a program.

use block_programs::{Axis, Sensor, Value};
use protocol_core::time::Instant;
use sevenbot::health::{JointHealth, MoveWatch};
use sevenbot::{FineAngle, Health, Joint, Snapshot};

use super::failure::ProgramFailure;
use crate::client::BAUD;
use crate::stop::since_start;

/// Reads a sensor. An angle of a silent servo is old, so it is an error.
pub(super) fn read(sensor: Sensor, now: Instant, registers: &Snapshot) -> Result<Value, ProgramFailure> {
    let health = Health::new(registers);
    let told = |value: Option<f64>| value.map(Value::Number).ok_or(ProgramFailure::NotTold);
    let truth = |value: Option<bool>| value.map(Value::Truth).ok_or(ProgramFailure::NotTold);
    match sensor {
        Sensor::Angle(joint) => {
            MoveWatch::new(since_start(now), 0, BAUD)
                .of_positions()
                .registers(since_start(now), registers)?;
            told(of(&health, joint).position.map(FineAngle::degrees))
        }
        Sensor::Tip(axis) => {
            MoveWatch::new(since_start(now), 0, BAUD)
                .of_positions()
                .registers(since_start(now), registers)?;
            told(tip(&health).map(|[x, y, z]| match axis {
                Axis::X => x,
                Axis::Y => y,
                Axis::Z => z,
            }))
        }
        Sensor::Load(joint) => told(of(&health, joint).load_percent),
        Sensor::Blocked(joint) => truth(of(&health, joint).is_blocked),
        Sensor::Gripping => truth(health.joints.iter().filter_map(|joint| joint.is_gripping).max()),
    }
}

fn of(health: &Health, joint: Joint) -> &JointHealth {
    let [first, ..] = &health.joints;
    health.joints.get(usize::from(joint.index())).unwrap_or(first)
}

/// The tip in millimetres; `None` if a joint is not measured.
fn tip(health: &Health) -> Option<[f64; 3]> {
    let mut angles = [0.0; 6];
    for (angle, joint) in angles.iter_mut().zip(&health.joints) {
        *angle = joint.position?.degrees();
    }
    let tip = kinematics::forward(angles).hand.tip;
    Some([tip.x, tip.y, tip.z])
}
