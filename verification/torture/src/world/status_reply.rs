//! Status replies of servos in the bytes on the servo bus.

use motion_core::servo_bus::frame::Reading;
use protocol_core::registers::Joint;

/// The number of registers from the torque switch to the measurements.
const TO_MEASUREMENTS: usize = 16;

/// The fields of a servo's last reply, before any corruption.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StatusFields {
    pub(super) alarms: u8,
    /// In counts per second, without its sign.
    pub(super) speed: u16,
    pub(super) decivolts: u8,
    pub(super) celsius: u8,
}

/// The status in `bytes`, if they are exactly one reply with a valid checksum.
pub(super) fn whole_status(bytes: &[u8]) -> Option<(Joint, StatusFields)> {
    let &[0xFF, 0xFF, id, length, alarms, ref params @ .., _] = bytes else { return None };
    let is_whole = usize::from(length) == params.len() + 2 && has_valid_checksum(bytes);
    let &[_, _, s1, s0, _, _, decivolts, celsius, ..] = measurements(params)? else { return None };
    let speed = u16::from_be_bytes([s1 & 0x7F, s0]);
    Joint::from_index(id)
        .filter(|_| is_whole)
        .map(|joint| (joint, StatusFields { alarms, speed, decivolts, celsius }))
}

/// The measurements in the parameters of a status reply, from the position on.
pub(super) fn measurements(params: &[u8]) -> Option<&[u8]> {
    let first = if has_torque_switch(params) { TO_MEASUREMENTS } else { 0 };
    params.get(first..)
}

/// The torque switch in the parameters of a status reply, if the read included it.
pub(super) fn torque_switch(params: &[u8]) -> Option<u8> {
    params.first().copied().filter(|_| has_torque_switch(params))
}

/// The goal in the parameters of a status reply in counts, if the read included the torque switch. A goal that was corrupted
/// on the wire may be beyond the end of the servo's range. The servo then goes to that end.
pub(super) fn goal(params: &[u8]) -> Option<u16> {
    let &[_, _, high, low, ..] = params else { return None };
    has_torque_switch(params).then_some(u16::from_be_bytes([high, low]).min(Reading::MAX_POSITION))
}

fn has_torque_switch(params: &[u8]) -> bool {
    params.len() >= TO_MEASUREMENTS + usize::from(Reading::REGISTERS)
}

fn has_valid_checksum(frame: &[u8]) -> bool {
    let [_, _, covered @ .., checksum] = frame else { return false };
    covered.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)) == !checksum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_goal_beyond_the_end_is_the_end() {
        let mut params = [0; 25];
        for (written, meant) in [(512_u16, 512), (1_023, 1_023), (0xFF00, 1_023)] {
            [params[2], params[3]] = written.to_be_bytes();
            assert_eq!(goal(&params), Some(meant));
        }
        assert_eq!(goal(&params[..9]), None);
    }
}
