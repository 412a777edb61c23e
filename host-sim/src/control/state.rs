//! The state of an arm as JSON.

use arm_sim::controller::ArmController;
use arm_sim::faults::FaultReport;
use arm_sim::plant::Plant;
use arm_sim::world::Object;
use embedded_storage::nor_flash::NorFlash;
use motion_core::servo_bus::Torque;
use protocol_core::registers::map::{
    FAULTS, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, PRESENT_POSITION, TARGET_POSITION, fault,
};
use protocol_core::registers::{Joint, Register, RegisterFile};
use protocol_core::time::Instant;
use serde_json::{Value, json};

use crate::pty_arm::PtyArm;

/// The fault bits of register 241, and their names.
const FAULT_BITS: [(u8, &str); 7] = [
    (fault::SETTINGS_STORAGE, "settings storage"),
    (fault::SERVO_BUS, "servo bus"),
    (fault::WATCHDOG_RESTART, "watchdog restart"),
    (fault::BROWN_OUT_RESTART, "brown-out restart"),
    (fault::CRYSTAL_FAILED, "crystal failed"),
    (fault::RECEIVE_OVERRUN, "receive overrun"),
    (fault::HOST_SILENT, "host silent"),
];

/// The state of an arm at `now`.
pub fn of<F: NorFlash + Clone, C: ArmController>(pty_arm: &mut PtyArm<F, Plant, C>, now: Instant) -> Value {
    let port = pty_arm.port().to_string_lossy().into_owned();
    let ended_faults = reports(pty_arm.ended_faults(), now);
    let arm = pty_arm.simulation_mut();
    let faults = reports(&arm.faults(), now);
    let plant = arm.plant();
    json!({
        "port": port,
        "time_us": now.as_micros(),
        "power": if arm.has_power() { "on" } else { "off" },
        "controller": if !arm.has_power() { "off" } else if arm.is_halted() { "halted" } else { "running" },
        "supply_volts": f64::from(plant.supply_decivolts()) / 10.0,
        "weight_grams": plant.load_grams(),
        "objects": objects(plant),
        "joints": Joint::ALL.map(|joint| self::joint(plant, joint)),
        "registers": arm.controller().registers().map(registers),
        "faults": faults,
        "ended_faults": ended_faults,
    })
}

/// The objects of the scene, on the table or carried by the arm.
pub(super) fn objects(plant: &Plant) -> Vec<Value> {
    let of = |object: &Object| {
        let at = object.frame.origin;
        let tenths = |mm: f64| (mm * 10.0).round() / 10.0;
        json!({
            "name": object.item.name,
            "place_mm": [tenths(at.x), tenths(at.y), tenths(at.z)],
            "turn_degrees": tenths(object.frame.turn()),
            "is_carried": object.is_carried,
        })
    };
    plant.objects().iter().map(of).collect()
}

fn joint(plant: &Plant, joint: Joint) -> Value {
    let torque = match plant.torque(joint) {
        Some(Torque::On) => "on",
        Some(Torque::Damping) => "damping",
        Some(Torque::Free) => "free",
        None => "none",
    };
    json!({
        "joint": joint.number(),
        "angle_degrees": f64::from(plant.angle(joint)) / 1_000.0,
        "torque": torque,
        "servo_position": plant.position_counts(joint),
        "load_percent": f64::from(plant.load(joint)) / 10.0,
        "is_held": plant.is_held(joint),
    })
}

fn registers(registers: &RegisterFile) -> Value {
    let values = |row: Register| -> Vec<u8> {
        (row.address..).take(row.count.into()).map(|address| registers.get(address)).collect()
    };
    let joints = |row: Register| -> Vec<u8> {
        let bits = registers.get(row.address);
        Joint::ALL.iter().filter(|joint| bits >> joint.index() & 1 != 0).map(|joint| joint.number()).collect()
    };
    let bits = registers.get(FAULTS.address);
    let faults: Vec<&str> =
        FAULT_BITS.iter().filter(|(bit, _)| bits & bit != 0).map(|(_, name)| *name).collect();
    json!({
        "motor_state": registers.get(MOTOR_STATE.address),
        "target_positions": values(TARGET_POSITION),
        "present_positions": values(PRESENT_POSITION),
        "moving_joints": joints(MOVING_JOINTS),
        "missing_servos": joints(MISSING_SERVOS),
        "faults": faults,
    })
}

/// The reports of faults as JSON, with the remaining time of each fault at `now`.
#[must_use]
pub fn reports(reports: &[FaultReport], now: Instant) -> Vec<Value> {
    reports.iter().map(|report| self::report(report, now)).collect()
}

fn report(report: &FaultReport, now: Instant) -> Value {
    json!({
        "fault": report.fault.to_string(),
        "effects": report.count.map(|count| count.effects),
        "occasions": report.count.map(|count| count.occasions),
        "unit": report.fault.unit(),
        "had_no_effect": report.had_no_effect(),
        "remaining_ms": report.remaining(now).map(|time| time.as_micros() / 1_000),
        "text": report.to_string(),
    })
}
