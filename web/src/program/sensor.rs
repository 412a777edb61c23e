//! Reads the sensors of a program from the registers.

use block_programs::{Axis, Sensor, Value};
use protocol_core::time::Instant;
use sevenbot::health::{JointHealth, MoveWatch};
use sevenbot::{FineAngle, Health, Joint, Snapshot};

use super::failure::ProgramFailure;
use crate::arm_state::ArmState;
use crate::client::BAUD;
use crate::stop::since_start;

/// Reads a sensor.
///
/// # Errors
/// A servo is silent, so that its values are old, the firmware does not provide the value, or a joint was not measured.
pub(super) fn read(sensor: Sensor, now: Instant, registers: &Snapshot) -> Result<Value, ProgramFailure> {
    MoveWatch::new(since_start(now), 0, BAUD).of_positions().registers(since_start(now), registers)?;
    let health = Health::new(registers);
    let told = |value: Option<f64>| value.map(Value::Number).ok_or(ProgramFailure::NotTold);
    let truth = |value: Option<bool>| value.map(Value::Truth).ok_or(ProgramFailure::NotTold);
    match sensor {
        Sensor::Angle(joint) => told(of(&health, joint).position.map(FineAngle::degrees)),
        Sensor::Tip(axis) => told(ArmState::new(registers).tip().map(|[x, y, z]| match axis {
            Axis::X => x,
            Axis::Y => y,
            Axis::Z => z,
        })),
        Sensor::Load(joint) => told(of(&health, joint).load_percent),
        Sensor::Blocked(joint) => truth(of(&health, joint).is_blocked),
        Sensor::Gripping => truth(health.joints.iter().filter_map(|joint| joint.is_gripping).max()),
    }
}

fn of(health: &Health, joint: Joint) -> &JointHealth {
    let [first, ..] = &health.joints;
    health.joints.get(usize::from(joint.index())).unwrap_or(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tab::Tab;
    use crate::texts::Language;
    use crate::words::program_failure;

    #[test]
    fn what_a_silent_servo_told_is_no_value() {
        let [first, .., claw] = Joint::ALL;
        let sensors = [
            Sensor::Angle(first),
            Sensor::Tip(Axis::X),
            Sensor::Load(first),
            Sensor::Blocked(first),
            Sensor::Gripping,
        ];
        let mut tab = Tab::new();
        let read = |tab: &Tab, sensor| read(sensor, tab.now(), tab.client.registers());
        assert!(sensors.iter().all(|sensor| read(&tab, *sensor).is_ok()));
        for joint in [first, claw] {
            tab.act(&format!("fault {}=missing", joint.number()));
        }
        tab.pass(60);
        for sensor in sensors {
            let failure = read(&tab, sensor).expect_err("the servo is silent");
            assert!(
                program_failure(Language::English, &failure).contains("does not answer"),
                "{sensor:?}: {failure:?}"
            );
        }
    }
}
