//! The health of an arm from literal registers.

use super::*;
use protocol_core::registers::map::{
    EXTENDED_VERSION, FINE_POSITION, FINE_TARGET, LOAD, MEASURED_JOINTS, MOVING_JOINTS, PRESENT_POSITION,
    PROTECTION_VERSION, STATUS_VERSION, TARGET_POSITION,
};

/// Registers of an arm of this firmware that stands in the standard pose.
pub(crate) fn healthy_registers() -> Snapshot {
    let mut registers = Snapshot { address: 0, values: vec![0; 256] };
    let pose = [90, 90, 65, 90, 90, 90, 80];
    set(&mut registers, MOTOR_STATE.address, &[motor_state::SERVO]);
    set(&mut registers, TARGET_POSITION.address, &pose);
    set(&mut registers, PRESENT_POSITION.address, &pose);
    let fine: Vec<u8> = pose.iter().flat_map(|&degrees| (u16::from(degrees) * 100).to_le_bytes()).collect();
    set(&mut registers, FINE_TARGET.address, &fine);
    set(&mut registers, FINE_POSITION.address, &fine);
    set(&mut registers, MEASURED_JOINTS.address, &[0x7F]);
    set(&mut registers, EXTENDED_VERSION.address, &[1, 1, 70, 40]);
    set(&mut registers, PROTECTION_VERSION.address, &[1]);
    set(&mut registers, STATUS_VERSION.address, &[1]);
    set(&mut registers, SUPPLY_VOLTAGE.address, &[74, 31]);
    registers
}

pub(crate) fn set(registers: &mut Snapshot, address: u8, values: &[u8]) {
    registers.put(&Snapshot { address, values: values.to_vec() });
}

fn with(address: u8, values: &[u8]) -> Health {
    let mut registers = healthy_registers();
    set(&mut registers, address, values);
    Health::new(&registers)
}

fn said(health: &Health) -> Vec<String> {
    health.problems().iter().map(Problem::to_string).collect()
}

#[test]
fn a_healthy_arm_has_no_problem() {
    let health = Health::new(&healthy_registers());
    assert_eq!(health.problems(), []);
    assert!(health.is_driven() && health.joints.iter().all(|joint| joint.is_at_target));
    assert_eq!((health.supply_volts, health.hottest_celsius), (Some(7.4), Some(31)));
    assert_eq!((health.is_protected, health.alarms), (Some(true), Some(0)));
}

#[test]
fn d30_each_flag_of_a_joint_is_a_problem_with_the_joint_named() {
    let blocked = with(BLOCKED_JOINTS.address, &[0b10]);
    assert_eq!(said(&blocked), ["joint 2 is blocked: something keeps it from its target"]);
    assert_eq!(blocked.joints[1].word(true), "blocked");
    let let_go = with(LET_GO_JOINTS.address, &[0b110]);
    assert_eq!(said(&let_go).len(), 2);
    assert!(said(&let_go)[1].starts_with("joint 3 let go"), "{:?}", said(&let_go));
    let silent = with(MISSING_SERVOS.address, &[1]);
    assert!(said(&silent)[0].starts_with("joint 1 does not answer"));
    let all = with(MISSING_SERVOS.address, &[0x7F]);
    assert_eq!(said(&all), ["no servo answers"]);
    assert_eq!(all.joints[6].word(true), "no answer");
}

#[test]
fn d30_alarms_and_a_lost_supply_are_problems_of_the_arm() {
    let alarms = with(SERVO_ALARMS.address, &[0b10_0101]);
    let kinds: Vec<_> = alarms.problems().iter().map(|problem| problem.kind).collect();
    assert_eq!(kinds, [ProblemKind::Voltage, ProblemKind::Overload, ProblemKind::Overheat]);
    let lost = with(SUPPLY_LOST.address, &[1]);
    assert_eq!(lost.problems(), [Problem::of_arm(ProblemKind::SupplyLost)]);
}

#[test]
fn the_bit_of_the_servo_bus_is_told_only_if_nothing_else_explains_it() {
    let mut registers = healthy_registers();
    set(&mut registers, FAULTS.address, &[fault::SERVO_BUS | fault::HOST_SILENT]);
    let kinds = |registers: &Snapshot| {
        Health::new(registers).problems().iter().map(|problem| problem.kind).collect::<Vec<_>>()
    };
    assert_eq!(kinds(&registers), [ProblemKind::ServoBus, ProblemKind::HostSilent]);
    set(&mut registers, SERVO_ALARMS.address, &[0b10_0000]);
    assert_eq!(kinds(&registers), [ProblemKind::Overload, ProblemKind::HostSilent]);
}

#[test]
fn the_makers_firmware_tells_positions_and_nothing_else() {
    let mut registers = Snapshot { address: 0, values: vec![0; 256] };
    set(&mut registers, MOTOR_STATE.address, &[motor_state::SERVO]);
    set(&mut registers, TARGET_POSITION.address, &[90; 7]);
    set(&mut registers, PRESENT_POSITION.address, &[91; 7]);
    // Other firmware may show anything there.
    set(&mut registers, BLOCKED_JOINTS.address, &[0x7F]);
    let health = Health::new(&registers);
    assert_eq!(health.problems(), []);
    let joint = health.joints[0];
    assert_eq!((joint.is_silent, joint.is_blocked, joint.load_percent), (None, None, None));
    assert!(joint.is_at_target, "within three degrees of its target");
    assert_eq!((health.faults, health.alarms, health.supply_volts), (None, None, None));
}

#[test]
fn a_joint_that_rests_away_from_its_target_says_so() {
    let mut registers = healthy_registers();
    set(&mut registers, FINE_POSITION.address, &8_500_u16.to_le_bytes());
    set(&mut registers, LOAD.address, &(-284_i16).to_le_bytes());
    let joint = Health::new(&registers).joints[0];
    assert_eq!((joint.word(true).as_str(), joint.load_percent), ("5.0° from its target", Some(-28.4)));
    assert_eq!(joint.word(false), "", "the motors are off");
    set(&mut registers, MOVING_JOINTS.address, &[1]);
    assert_eq!(Health::new(&registers).joints[0].word(true), "moving");
    set(&mut registers, MEASURED_JOINTS.address, &[0x7E]);
    assert_eq!(Health::new(&registers).joints[0].position, None);
}
