//! The positions in a write of map 2.1, and the joint angles that reach them ([M7](protocol_core::decisions#m7)).
//!
//! ```text
//!   68..73  wrist                        IK5: joints 1 to 3
//!   54..62  tip, tool direction          IK6: joints 1 to 5
//!   54..65  tip, tool, disc direction    IK7: joints 1 to 6
//! ```
//!
//! A block counts only if the frame covers the whole of it. This file does not know how joints move.

use kinematics::{NoSolution, Vector, ik5, ik6, ik7};
use protocol_core::registers::map21::{
    DIRECTION_ZERO, DISC_DIRECTION, POSITION_ZERO, TIP_POSITION, TOOL_DIRECTION, WRIST_POSITION,
};
use protocol_core::registers::{Accepted, JOINTS, Joint};
use protocol_core::request::Alarm;

use crate::calibration::MicroDegrees;

/// The joint targets with which the arm reaches the positions in a write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reached {
    /// `None` for a joint that keeps its target.
    pub(crate) targets: [Option<MicroDegrees>; JOINTS],
    /// The lowest register of the blocks that set targets.
    pub(crate) address: u8,
}

impl Reached {
    /// A write without positions.
    pub(crate) const NONE: Self = Self { targets: [None; JOINTS], address: 0 };

    /// The target of one joint; `None` if the joint keeps its target.
    pub(crate) fn target(&self, joint: Joint) -> Option<MicroDegrees> {
        self.targets.get(usize::from(joint.index())).copied().flatten()
    }

    fn set(&mut self, address: u8, angles: &[f32]) {
        self.address = address;
        for (target, &angle) in self.targets.iter_mut().zip(angles) {
            *target = Some(MicroDegrees::nearest(angle));
        }
    }
}

/// A position in a write that no joint angles reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutOfReach {
    /// The first register of the block.
    pub(crate) address: u8,
    pub(crate) alarm: Alarm,
}

impl OutOfReach {
    /// IK`number` has no solution for the block that begins at `address`.
    fn of(address: u8, number: u8) -> impl Fn(NoSolution) -> Self {
        move |_| Self { address, alarm: Alarm::out_of_reach(number) }
    }
}

/// Returns whether there are joint angles for all positions in a write. If not, the arm refuses the write
/// ([M7](protocol_core::decisions#m7)).
#[must_use]
pub fn is_within(accepted: &Accepted<'_>) -> bool {
    targets(accepted).is_ok()
}

/// Solves the blocks of a write: IK5 first, then IK6 or IK7, whose angles replace the angles of IK5.
pub(crate) fn targets(accepted: &Accepted<'_>) -> Result<Reached, OutOfReach> {
    let mut reached = Reached::NONE;
    if let Some(wrist) = accepted.values_at(WRIST_POSITION.address) {
        let angles = ik5(position(wrist)).map_err(OutOfReach::of(WRIST_POSITION.address, 5))?;
        reached.set(WRIST_POSITION.address, &angles);
    }
    let (tip, tool) = (accepted.values_at(TIP_POSITION.address), accepted.values_at(TOOL_DIRECTION.address));
    if let (Some(tip), Some(tool)) = (tip, tool) {
        let (tip, tool) = (position(tip), direction(tool));
        if let Some(disc) = accepted.values_at(DISC_DIRECTION.address) {
            let angles = ik7(tip, tool, direction(disc)).map_err(OutOfReach::of(TIP_POSITION.address, 7))?;
            reached.set(TIP_POSITION.address, &angles);
        } else {
            let angles = ik6(tip, tool).map_err(OutOfReach::of(TIP_POSITION.address, 6))?;
            reached.set(TIP_POSITION.address, &angles);
        }
    }
    Ok(reached)
}

/// The position in millimetres that six registers hold.
#[must_use]
pub fn position([x1, x0, y1, y0, z1, z0]: [u8; 6]) -> Vector<f32> {
    let millimetres =
        |high, low| float(i32::from(u16::from_be_bytes([high, low])) - i32::from(POSITION_ZERO));
    Vector::new(millimetres(x1, x0), millimetres(y1, y0), millimetres(z1, z0))
}

/// The direction that three registers hold, of any length.
#[must_use]
pub fn direction([x, y, z]: [u8; 3]) -> Vector<f32> {
    let component = |byte: u8| f32::from(i16::from(byte) - i16::from(DIRECTION_ZERO));
    Vector::new(component(x), component(y), component(z))
}

/// A whole number below 2^24, which `f32` holds exactly.
#[expect(clippy::cast_precision_loss, reason = "the number has 17 bits")]
fn float(number: i32) -> f32 {
    number as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::RegisterFile;

    /// The targets of a write, in degrees.
    fn solved(address: u8, values: &[u8]) -> Result<Vec<f64>, OutOfReach> {
        let registers = RegisterFile::new([0; 6], None);
        let accepted = registers.check_map21(address, values).unwrap();
        let targets = targets(&accepted);
        assert_eq!(is_within(&accepted), targets.is_ok());
        let targets = targets?;
        Ok(targets.targets.into_iter().flatten().map(|angle| f64::from(angle.0) / 1e6).collect())
    }

    fn assert_near(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 0.001, "{found} {expected}");
        }
    }

    const TIP: [u8; 6] = [0x03, 0xCE, 0x04, 0xB9, 0x04, 0x32];
    const DOWN: [u8; 3] = [128, 128, 127];
    const FAR_TIP: [u8; 6] = [0x05, 0xF4, 0x04, 0xB9, 0x04, 0x32];
    const WRIST: [u8; 6] = [0x04, 0x64, 0x04, 0xC8, 0x04, 0x96];
    const FAR_WRIST: [u8; 6] = [0x05, 0x90, 0x04, 0, 0x04, 0x64];

    #[test]
    fn m07_whole_blocks_are_solved() {
        let ik6 = [105.124, 88.229, 109.746, 90.0, 135.254];
        assert_near(&solved(68, &WRIST).unwrap(), &[63.435, 90.382, 85.029]);
        assert_near(&solved(54, &[&TIP[..], &DOWN].concat()).unwrap(), &ik6);
        // The maker's table has 128.006 degrees for joint 6 if the disc points to (3, 4, 0).
        let ik7 = solved(54, &[&TIP[..], &DOWN, &[131, 132, 128]].concat()).unwrap();
        assert_near(&ik7, &[&ik6[..], &[128.006]].concat());
    }

    #[test]
    fn m07_a_part_of_the_last_block_is_an_ik6() {
        assert_eq!(solved(54, &[&TIP[..], &DOWN, &[131, 132]].concat()).unwrap().len(), 5);
    }

    #[test]
    fn m07_a_part_of_a_block_is_not_solved() {
        assert_eq!(solved(54, &[&TIP[..], &DOWN[..2]].concat()).unwrap(), []);
        assert_eq!(solved(55, &[&TIP[1..], &DOWN, &DOWN].concat()).unwrap(), []);
        assert_eq!(solved(68, &WRIST[..5]).unwrap(), []);
        assert_eq!(solved(69, &WRIST[1..]).unwrap(), []);
    }

    #[test]
    fn m07_both_blocks_in_one_frame() {
        let frame = |tip: [u8; 6], disc: &[u8], wrist: [u8; 6]| {
            solved(54, &[&tip[..], &DOWN, disc, &[0, 0], &wrist].concat())
        };
        let found = frame(TIP, &[129, 128, 128], WRIST).unwrap();
        assert_near(&found[..5], &[105.124, 88.229, 109.746, 90.0, 135.254]);
        let out = |address, kind| Err(OutOfReach { address, alarm: Alarm::out_of_reach(kind) });
        assert_eq!(frame(TIP, &[129, 128, 128], FAR_WRIST), out(68, 5));
        assert_eq!(frame(FAR_TIP, &[129, 128, 128], WRIST), out(54, 7));
        assert_eq!(frame(FAR_TIP, &[129, 128, 128], FAR_WRIST), out(68, 5));
        assert_eq!(solved(54, &[&FAR_TIP[..], &DOWN].concat()), out(54, 6));
    }

    #[test]
    fn m07_what_has_no_direction_has_no_solution() {
        let zero = [128; 3];
        let out = |kind| Err(OutOfReach { address: 54, alarm: Alarm::out_of_reach(kind) });
        assert_eq!(solved(54, &[&TIP[..], &zero].concat()), out(6));
        assert_eq!(solved(54, &[&TIP[..], &DOWN, &zero].concat()), out(7));
        assert_eq!(solved(54, &[&TIP[..], &DOWN, &[128, 128, 200]].concat()), out(7), "parallel");
        assert!(solved(68, &[4, 0, 4, 0, 4, 200]).is_err(), "no heading");
    }
}
