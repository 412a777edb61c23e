//! The last target of each joint, and the speed and time of its next goal.

use alloc::vec::Vec;

use motion_core::calibration::{MicroDegrees, counts_from_angle};
use protocol_core::registers::map::{SPEED, TIME};
use protocol_core::registers::{JOINTS, Joint};

use super::registers::StockRegisters;
use super::servo_master::StockGoal;

/// Speed in counts per second, and time, of the first goals after the move at start.
const SPEED_AT_START: u16 = 600;
const TIME_AT_START_MS: u16 = 1_000;
/// A unit of the speed registers in counts per second, and of the time registers in milliseconds.
const SPEED_UNIT: u16 = 10;
const TIME_UNIT_MS: u16 = 100;

/// The last goals of all joints.
#[derive(Clone, Debug)]
pub(super) struct LastGoals([LastGoal; JOINTS]);

#[derive(Clone, Copy, Debug)]
struct LastGoal {
    /// In degrees. An equal target is not sent again.
    target: u8,
    /// In counts per second.
    speed: u16,
    time_ms: u16,
}

impl LastGoals {
    pub(super) fn new(targets: [u8; JOINTS]) -> Self {
        Self(targets.map(|target| LastGoal { target, speed: SPEED_AT_START, time_ms: TIME_AT_START_MS }))
    }

    /// The goals of all joints for their last targets, to be reached within this time.
    pub(super) fn within(&self, time_ms: u16, registers: &StockRegisters) -> Vec<(Joint, StockGoal)> {
        let goals = Joint::ALL.into_iter().zip(self.0);
        goals.map(|(joint, goal)| LastGoal { speed: 0, time_ms, ..goal }.of_servo(joint, registers)).collect()
    }

    /// Takes speeds and times from the registers that were written.
    pub(super) fn set_pace(&mut self, registers: &StockRegisters, is_written: impl Fn(u8) -> bool) {
        for (joint, goal) in Joint::ALL.into_iter().zip(&mut self.0) {
            let (speed, time) = (SPEED.of(joint), TIME.of(joint));
            if is_written(speed) {
                goal.speed = SPEED_UNIT * u16::from(registers.get(speed));
            }
            if is_written(time) {
                goal.time_ms = TIME_UNIT_MS * u16::from(registers.get(time));
            }
        }
    }

    /// Takes new targets. Returns goals for the joints whose target differs from the last one.
    pub(super) fn change(
        &mut self,
        targets: [Option<u8>; JOINTS],
        registers: &StockRegisters,
    ) -> Vec<(Joint, StockGoal)> {
        let mut goals = Vec::new();
        for ((joint, goal), target) in Joint::ALL.into_iter().zip(&mut self.0).zip(targets) {
            if let Some(target) = target.filter(|&target| target != goal.target) {
                goal.target = target;
                goals.push(goal.of_servo(joint, registers));
            }
        }
        goals
    }
}

impl LastGoal {
    fn of_servo(self, joint: Joint, registers: &StockRegisters) -> (Joint, StockGoal) {
        let angle = MicroDegrees::from_degrees(self.target);
        let position_counts = counts_from_angle(joint, angle, registers.offset(joint));
        (joint, StockGoal { position_counts, time_ms: self.time_ms, speed: self.speed })
    }
}
