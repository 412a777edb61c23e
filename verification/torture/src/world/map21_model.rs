//! The effect of a write of map 2.1, from docs/protocol.md, section 8, and not from the register tables under test.

use kinematics::{Vector, ik5, ik6, ik7};

/// The first register of the offsets, and the first after them.
const OFFSETS: (u8, u8) = (13, 20);
/// The first register of the position of the wrist.
const WRIST: u8 = 68;
/// The first register of the position of the tip.
const TIP: u8 = 54;

/// A write has a position that no joint angles reach (M7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OutOfReach {
    /// The first register of the block.
    pub(super) address: u8,
    /// 5, 6 or 7: the kind of the alarm.
    pub(super) kind: u8,
}

/// True if a write of map 2.1 has an effect on the register `at`, with an open lock (M2).
pub(super) const fn is_writable(at: u8) -> bool {
    matches!(at, 11..=20 | 28..=52 | 54..=66 | 68..=73 | 82 | 90)
}

/// True if the value is in the range of a writable register (M2, M5, M6).
pub(super) const fn is_in_range(at: u8, value: u8) -> bool {
    let most = match at {
        13..=19 => return matches!(value, 0..=16 | 112..=144 | 240..=255),
        12 => 7,
        20 => 3,
        28 | 30 | 31 | 66 => 1,
        29 => 2,
        32..=45 | 82 | 90 => 100,
        46..=52 => 180,
        _ => 255,
    };
    value <= most
}

const fn is_offset(at: u8) -> bool {
    OFFSETS.0 <= at && at < OFFSETS.1
}

/// The value to store: offsets in sign and magnitude (M5).
pub(super) const fn stored(at: u8, value: u8) -> u8 {
    match value {
        _ if !is_offset(at) => value,
        112..=127 => 0x80 | (128 - value),
        128..=144 => value - 128,
        240..=255 => 0x80 | 0_u8.wrapping_sub(value),
        _ => value,
    }
}

/// The value that a read shows after a write of map 2.1: offsets as 128 + offset (M5).
pub(super) const fn shown(at: u8, stored: u8) -> u8 {
    match stored {
        _ if !is_offset(at) => stored,
        0x80.. => 128 - (stored & 0x7F),
        _ => 128 + stored,
    }
}

/// The angles in degrees that a write gives to joints 1 to 7; `None` where it gives none (M7).
pub(super) fn angles(address: u8, values: &[u8]) -> Result<[Option<f32>; 7], OutOfReach> {
    let mut angles = [None; 7];
    if let Some(wrist) = block(address, values, WRIST) {
        put(&mut angles, &ik5(position(wrist)).map_err(|_| OutOfReach { address: WRIST, kind: 5 })?);
    }
    let tip = block::<9>(address, values, TIP);
    if let Some([x1, x0, y1, y0, z1, z0, tool @ ..]) = tip {
        let (tip, tool) = (position([x1, x0, y1, y0, z1, z0]), direction(tool));
        let disc = block::<12>(address, values, TIP);
        if let Some([_, _, _, _, _, _, _, _, _, disc @ ..]) = disc {
            let found = ik7(tip, tool, direction(disc));
            put(&mut angles, &found.map_err(|_| OutOfReach { address: TIP, kind: 7 })?);
        } else {
            put(&mut angles, &ik6(tip, tool).map_err(|_| OutOfReach { address: TIP, kind: 6 })?);
        }
    }
    Ok(angles)
}

/// The first register of the first position block that a write covers: the tip before the wrist. Use only if it covers one.
pub(super) fn block_of(address: u8, values: &[u8]) -> u8 {
    if block::<9>(address, values, TIP).is_some() { TIP } else { WRIST }
}

fn put(angles: &mut [Option<f32>; 7], found: &[f32]) {
    angles.iter_mut().zip(found).for_each(|(angle, found)| *angle = Some(*found));
}

/// The `N` values from `first` on, if the write covers them all.
fn block<const N: usize>(address: u8, values: &[u8], first: u8) -> Option<[u8; N]> {
    let rest = values.get(usize::from(first.checked_sub(address)?)..)?;
    rest.first_chunk().copied()
}

/// A position in millimetres. Uses `f32` as the controller does, so that model and controller agree at the limit of the reach.
fn position([x1, x0, y1, y0, z1, z0]: [u8; 6]) -> Vector<f32> {
    let millimetres = |high, low| f32::from(u16::from_be_bytes([high, low])) - 1024.0;
    Vector::new(millimetres(x1, x0), millimetres(y1, y0), millimetres(z1, z0))
}

fn direction([x, y, z]: [u8; 3]) -> Vector<f32> {
    let component = |byte| f32::from(byte) - 128.0;
    Vector::new(component(x), component(y), component(z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_have_the_documented_bytes() {
        assert_eq!([126, 130, 254, 2, 128, 0].map(|byte| stored(14, byte)), [0x82, 2, 0x82, 2, 0, 0]);
        assert_eq!([0x82, 2, 0, 0x80].map(|byte| shown(14, byte)), [126, 130, 128, 128]);
        assert_eq!((stored(12, 126), shown(20, 3)), (126, 3), "no offsets");
        let allowed = (0..=255).filter(|&value| is_in_range(13, value)).count();
        assert_eq!(allowed, 2 * 33);
    }

    #[test]
    fn whole_blocks_are_solved() {
        let degrees = |address, values: &[u8]| {
            angles(address, values).map(|angles| angles.map(|angle| angle.map(|angle| angle.round())))
        };
        let ik6 = [0x03, 0xCE, 0x04, 0xB9, 0x04, 0x32, 128, 128, 127];
        let solved = [Some(105.0), Some(88.0), Some(110.0), Some(90.0), Some(135.0), None, None];
        assert_eq!(degrees(54, &ik6), Ok(solved));
        assert_eq!(degrees(54, &ik6[..8]), Ok([None; 7]));
        let far = [0x05, 0xF4, 0x04, 0xB9, 0x04, 0x32, 128, 128, 127];
        assert_eq!(degrees(54, &far), Err(OutOfReach { address: 54, kind: 6 }));
        let wrist = [4, 100, 4, 200, 4, 150];
        assert_eq!(degrees(68, &wrist).map(|angles| angles[2]), Ok(Some(85.0)));
    }
}
