//! The meaning of the registers of the protection block, from docs/protocol.md.

use protocol_core::registers::Joint;
use protocol_core::registers::map::EFFECTOR_TYPE;

/// 1: the limits act (D27).
pub(super) const PROTECTION: u8 = 192;
/// The limit of joints 1 to 6, and of joint 7 without a gripper, in percent.
pub(super) const PUSH_LIMIT: u8 = 193;
/// The limit of a gripper in percent.
pub(super) const GRIP_LIMIT: u8 = 194;
/// Joints that are let go, bit n-1 = joint n (D28).
pub(super) const LET_GO: u8 = 196;
/// 1: the arm entered state 0 because the supply of its servos was lost (D29).
pub(super) const SUPPLY_LOST: u8 = 198;

/// The limit of a joint's push in 0.1 % of the stall torque; `None` without protection (D27).
pub(super) fn limit(joint: Joint, register: impl Fn(u8) -> u8) -> Option<i16> {
    let grips = joint.number() == 7 && register(EFFECTOR_TYPE.address) == 1;
    let percent = register(if grips { GRIP_LIMIT } else { PUSH_LIMIT });
    (register(PROTECTION) == 1).then_some(i16::from(percent) * 10)
}
