//! Encodes the positions and directions in JSON as the register blocks of map 2.1 for inverse kinematics
//! ([M7](protocol_core::decisions#m7)).

use motion_core::reach;
use protocol_core::registers::RegisterFile;
use protocol_core::registers::map21::{
    DIRECTION_ZERO, DISC_DIRECTION, POSITION_ZERO, TIP_POSITION, TOOL_DIRECTION, WRIST_POSITION,
};
use serde_json::Value;

/// Length of a direction in the registers: the greatest component that a byte holds.
const DIRECTION_LENGTH: f64 = 127.0;

/// A block that the arm solves as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum IkBlock {
    /// The position of the wrist.
    Ik5,
    /// The position of the tip and the direction of the tool.
    Ik6,
    /// The position of the tip, the direction of the tool, and the direction of the disc of joint 6.
    Ik7,
}

impl IkBlock {
    /// The first register.
    pub(super) const fn address(self) -> u8 {
        match self {
            Self::Ik5 => WRIST_POSITION.address,
            Self::Ik6 | Self::Ik7 => TIP_POSITION.address,
        }
    }

    /// The registers for the parameters of a message.
    ///
    /// # Errors
    /// A parameter is missing, or is not an array of three numbers.
    pub(super) fn values(self, message: &Value) -> Result<Vec<u8>, String> {
        let mut values = position(three(message, "pos")?).to_vec();
        if matches!(self, Self::Ik6 | Self::Ik7) {
            values.extend(direction(three(message, "vec56")?));
        }
        if self == Self::Ik7 {
            values.extend(direction(three(message, "vec67")?));
        }
        debug_assert_eq!(values.len(), self.count());
        Ok(values)
    }

    fn count(self) -> usize {
        let tip = TIP_POSITION.count + TOOL_DIRECTION.count;
        usize::from(match self {
            Self::Ik5 => WRIST_POSITION.count,
            Self::Ik6 => tip,
            Self::Ik7 => tip + DISC_DIRECTION.count,
        })
    }
}

/// Are there joint angles for the block in these registers? Makes the same check as the arm.
pub(super) fn has_solution(address: u8, values: &[u8]) -> bool {
    let registers = RegisterFile::new([0; 6], None);
    registers.check_map21(address, values).is_ok_and(|accepted| reach::is_within(&accepted))
}

/// A parameter that is an array of three numbers.
fn three(message: &Value, name: &str) -> Result<[f64; 3], String> {
    let parameter = message.get(name).ok_or_else(|| format!("Missing {name} parameter"))?;
    let numbers: Option<Vec<f64>> =
        parameter.as_array().and_then(|numbers| numbers.iter().map(Value::as_f64).collect());
    let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| format!("{name} array must have 3 numbers"))
}

/// Whole millimetres plus 1024, high byte first. A position beyond the range of the registers is clamped to it, and
/// is still out of reach.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the type")]
fn position(millimetres: [f64; 3]) -> [u8; 6] {
    let [x, y, z] = millimetres.map(|value| {
        ((value.round() + f64::from(POSITION_ZERO)).clamp(0.0, f64::from(u16::MAX)) as u16).to_be_bytes()
    });
    [x[0], x[1], y[0], y[1], z[0], z[1]]
}

/// The direction at full length, rounded. A direction of zero stays zero, and the arm refuses it.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the type")]
fn direction(components: [f64; 3]) -> [u8; 3] {
    let greatest = components.iter().fold(0.0, |greatest: f64, value| greatest.max(value.abs()));
    let unit = components.map(|value| if greatest > 0.0 { value / greatest } else { 0.0 });
    let length = unit.iter().map(|value| value * value).sum::<f64>().sqrt().max(1.0);
    unit.map(|value| {
        ((value * DIRECTION_LENGTH / length).round() + f64::from(DIRECTION_ZERO)).clamp(0.0, 255.0) as u8
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    fn values(block: IkBlock, text: &str) -> Result<Vec<u8>, String> {
        block.values(&serde_json::from_str(text).unwrap())
    }

    /// The positions are those of the maker's golden frames. Their directions have length 1; here they are scaled to 127.
    #[test]
    fn blocks_are_encoded_as_the_makers_client_does() {
        let ik5 = values(IkBlock::Ik5, r#"{"pos":[-120,180,60]}"#).unwrap();
        assert_eq!((IkBlock::Ik5.address(), ik5), (68, vec![0x03, 0x88, 0x04, 0xB4, 0x04, 0x3C]));
        let ik6 = values(IkBlock::Ik6, r#"{"pos":[-50,185,50],"vec56":[0,0,-1]}"#).unwrap();
        assert_eq!(
            (IkBlock::Ik6.address(), ik6),
            (54, vec![0x03, 0xCE, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x01])
        );
        let ik7 = values(IkBlock::Ik7, r#"{"pos":[100,200,150],"vec56":[0,0,1],"vec67":[0,2.5,0]}"#).unwrap();
        let directions = [0x80, 0x80, 0xFF, 0x80, 0xFF, 0x80];
        assert_eq!((IkBlock::Ik7.address(), ik7.len(), ik7.get(6..)), (54, 12, Some(directions.as_slice())));
    }

    #[test]
    fn fractions_are_rounded_and_directions_are_scaled_before() {
        assert_eq!(position([0.5, -0.6, 99.4]), [0x04, 0x01, 0x03, 0xFF, 0x04, 0x63]);
        assert_eq!(position([1e300, -1e300, 0.0]), [0xFF, 0xFF, 0, 0, 0x04, 0x00]);
        assert_eq!(direction([0.003, 0.004, 0.0]), [128 + 76, 128 + 102, 128]);
        assert_eq!(direction([1e300, -1e300, 0.0]), [128 + 90, 128 - 90, 128]);
        assert_eq!(direction([0.0; 3]), [128; 3]);
    }

    #[test]
    fn missing_and_misshapen_parameters_are_errors() {
        let cases = [
            (r#"{}"#, "Missing pos parameter"),
            (r#"{"pos":[1,2]}"#, "pos array must have 3 numbers"),
            (r#"{"pos":[1,2,"3"]}"#, "pos array must have 3 numbers"),
            (r#"{"pos":[1,2,3]}"#, "Missing vec56 parameter"),
            (r#"{"pos":[1,2,3],"vec56":[0,0,0,0,1]}"#, "vec56 array must have 3 numbers"),
            (r#"{"pos":[1,2,3],"vec56":[0,0,1]}"#, "Missing vec67 parameter"),
        ];
        for (text, message) in cases {
            assert_eq!(values(IkBlock::Ik7, text), Err(message.to_owned()), "{text}");
        }
    }
}
