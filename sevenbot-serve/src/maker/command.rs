//! One message of the maker's WebSocket: its JSON, the ranges of its values, and the texts of its errors.
//!
//! The texts are the maker's, because programs may compare them.

use protocol_core::registers::map::{MOTOR_STATE, SPEED, TARGET_POSITION, TIME, VACUUM_PUMP};
use protocol_core::registers::{JOINTS, Register};
use serde_json::Value;

use super::block::IkBlock;

/// What a message asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MakerCommand {
    /// Asks whether the server answers.
    Ping,
    /// Reads registers, for `read`.
    Read {
        /// The first register.
        address: u8,
        /// The number of registers, 1 to 255.
        count: u8,
    },
    /// Writes registers, for `write`, `angle`, `angles`, `speed`, `time`, `status` and `vacuum`.
    Write {
        /// The first register.
        address: u8,
        /// One byte per register.
        values: Vec<u8>,
        /// The text of the answer if the hub takes the write.
        done: &'static str,
    },
    /// Writes a block of registers for which the arm finds joint angles ([M7](protocol_core::decisions#m7)).
    InverseKinematics {
        /// The first register of the block.
        address: u8,
        /// One byte per register.
        values: Vec<u8>,
    },
    /// Holds every joint where it is.
    Stop,
}

/// Why a message is no command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MakerCommandError {
    /// The text for the client.
    pub message: String,
    /// The message wanted a read: its sender waits for an answer.
    pub is_read: bool,
}

impl MakerCommand {
    /// Parses a message.
    ///
    /// # Errors
    /// See [`MakerCommandError`].
    pub fn parse(text: &str) -> Result<Self, MakerCommandError> {
        let failed = |is_read| move |message| MakerCommandError { message, is_read };
        let message: Value =
            serde_json::from_str(text).map_err(|_| failed(false)("Invalid JSON format".to_owned()))?;
        let Some(name) = message.get("cmd") else {
            return Err(failed(false)("No 'cmd' field found in JSON".to_owned()));
        };
        let name = name.as_str().ok_or_else(|| failed(false)("Missing cmd parameter".to_owned()))?;
        parse_named(name, &message).map_err(failed(name == "read"))
    }
}

fn parse_named(name: &str, message: &Value) -> Result<MakerCommand, String> {
    match name {
        "ping" => Ok(MakerCommand::Ping),
        "stop" => Ok(MakerCommand::Stop),
        "read" => read(message),
        "write" => write(message),
        "angle" => angle(message),
        "angles" => angles(message),
        "speed" => each_joint(&SPEED, message, "speed", "Invalid speed value (0-100)", "Speed set"),
        "time" => each_joint(&TIME, message, "time", "Invalid time value (0-100, unit: 100ms)", "Time set"),
        "status" => status(message),
        "vacuum" => vacuum(message),
        "IK5" => inverse_kinematics(IkBlock::Ik5, message),
        "IK6" => inverse_kinematics(IkBlock::Ik6, message),
        "IK7" => inverse_kinematics(IkBlock::Ik7, message),
        _ => Err("Unknown command".to_owned()),
    }
}

fn read(message: &Value) -> Result<MakerCommand, String> {
    let missing = "Missing id or num parameters for read command";
    let (first, number) = (whole(message, "id", missing)?, whole(message, "num", missing)?);
    match (u8::try_from(first), u8::try_from(number)) {
        (Ok(address), Ok(count @ 1..)) if first + number <= 256 => Ok(MakerCommand::Read { address, count }),
        _ => Err("Invalid id or num range".to_owned()),
    }
}

fn write(message: &Value) -> Result<MakerCommand, String> {
    let missing = "Missing id, num, or value parameters for write command";
    let (first, number) = (whole(message, "id", missing)?, whole(message, "num", missing)?);
    let values = message.get("value").ok_or(missing)?;
    let values = values.as_array().ok_or("Value must be an array for write command")?;
    let bytes: Option<Vec<u8>> = values.iter().map(|value| byte(value.as_i64()?)).collect();
    let bytes = bytes.ok_or("Invalid value for write command (-128 to 255)")?;
    let is_whole = usize::try_from(number) == Ok(bytes.len()) && !bytes.is_empty();
    match u8::try_from(first) {
        Ok(address) if is_whole && first + number <= 256 => {
            Ok(MakerCommand::Write { address, values: bytes, done: "Values written" })
        }
        _ => Err("Invalid id or num range".to_owned()),
    }
}

/// The byte of a value from -128 to 255; negative ones in two's complement.
fn byte(value: i64) -> Option<u8> {
    u8::try_from(value).ok().or_else(|| i8::try_from(value).ok().map(i8::cast_unsigned))
}

fn angle(message: &Value) -> Result<MakerCommand, String> {
    let missing = "Missing id or angle parameters";
    let joint = whole(message, "id", missing)?;
    let angle = message.get("angle").and_then(Value::as_f64).ok_or(missing)?;
    let value = rounded(angle, 180).ok_or("Invalid id or angle value")?;
    match u8::try_from(joint) {
        Ok(joint) if usize::from(joint) < JOINTS => Ok(MakerCommand::Write {
            address: TARGET_POSITION.address + joint,
            values: vec![value],
            done: "Angle set",
        }),
        _ => Err("Invalid id or angle value".to_owned()),
    }
}

fn angles(message: &Value) -> Result<MakerCommand, String> {
    let angles = message.get("angles").ok_or("Missing angles parameter")?.as_array();
    let angles = angles.filter(|angles| !angles.is_empty()).ok_or("angles array is empty or invalid")?;
    if angles.len() != JOINTS {
        return Err(format!("angles array must have 7 elements, got {}", angles.len()));
    }
    let value = |(index, angle): (usize, &Value)| {
        let angle = angle.as_f64().ok_or_else(|| format!("angles[{index}] must be a number"))?;
        rounded(angle, 180).ok_or_else(|| format!("angles[{index}] = {angle} is out of range [0, 180]"))
    };
    let values = angles.iter().enumerate().map(value).collect::<Result<_, _>>()?;
    Ok(MakerCommand::Write { address: TARGET_POSITION.address, values, done: "Angles set" })
}

fn each_joint(
    row: &Register,
    message: &Value,
    name: &str,
    invalid: &str,
    done: &'static str,
) -> Result<MakerCommand, String> {
    let value = whole(message, name, &format!("Missing {name} parameter"))?;
    let value = u8::try_from(value).ok().filter(|&value| row.range.contains(value.into())).ok_or(invalid)?;
    Ok(MakerCommand::Write { address: row.address, values: vec![value; JOINTS], done })
}

fn status(message: &Value) -> Result<MakerCommand, String> {
    let (value, done) = match whole(message, "status", "Missing status parameter")? {
        0 => (0, "Protection mode enabled"),
        1 => (1, "Servo mode enabled"),
        2 => (2, "Forceless mode enabled"),
        _ => return Err("Invalid status value (0 for protection, 1 for servo, 2 for forceless)".to_owned()),
    };
    Ok(MakerCommand::Write { address: MOTOR_STATE.address, values: vec![value], done })
}

fn vacuum(message: &Value) -> Result<MakerCommand, String> {
    let invalid = "Invalid vacuum status (0 or 1)";
    let (value, done) = match whole(message, "status", invalid)? {
        0 => (0, "Vacuum off"),
        1 => (1, "Vacuum on"),
        _ => return Err(invalid.to_owned()),
    };
    Ok(MakerCommand::Write { address: VACUUM_PUMP.address, values: vec![value], done })
}

fn inverse_kinematics(block: IkBlock, message: &Value) -> Result<MakerCommand, String> {
    let values = block.values(message)?;
    Ok(MakerCommand::InverseKinematics { address: block.address(), values })
}

/// A parameter that is a whole number of at most six digits.
fn whole(message: &Value, name: &str, missing: &str) -> Result<i64, String> {
    message
        .get(name)
        .and_then(Value::as_i64)
        .filter(|value| value.abs() < 1_000_000)
        .ok_or_else(|| missing.to_owned())
}

/// The nearest whole number, if it is in 0..=`most`.
fn rounded(value: f64, most: u8) -> Option<u8> {
    (0..=most).find(|&whole| (value - f64::from(whole)).abs() <= 0.5)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A panic is a failed test.
mod tests {
    use super::*;

    fn written(text: &str) -> (u8, Vec<u8>) {
        match MakerCommand::parse(text).unwrap() {
            MakerCommand::Write { address, values, .. } => (address, values),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn messages_of_the_makers_programs_are_commands() {
        assert_eq!(MakerCommand::parse(r#"{"cmd":"ping"}"#), Ok(MakerCommand::Ping));
        let read = MakerCommand::parse(r#"{"cmd":"read","id":83,"num":7}"#);
        assert_eq!(read, Ok(MakerCommand::Read { address: 83, count: 7 }));
        assert_eq!(written(r#"{"cmd":"angle","id":6,"angle":80}"#), (52, vec![80]));
        let angles = r#"{"cmd":"angles","angles":[90,90.4,65,90,90,90,79.6]}"#;
        assert_eq!(written(angles), (46, vec![90, 90, 65, 90, 90, 90, 80]));
        assert_eq!(written(r#"{"cmd":"speed","speed":60}"#), (32, vec![60; 7]));
        assert_eq!(written(r#"{"cmd":"time","time":5}"#), (39, vec![5; 7]));
        assert_eq!(written(r#"{"cmd":"status","status":2}"#), (29, vec![2]));
        assert_eq!(written(r#"{"cmd":"vacuum","status":1}"#), (31, vec![1]));
        let offsets = r#"{"cmd":"write","id":13,"num":3,"value":[1,-2,255]}"#;
        assert_eq!(written(offsets), (13, vec![1, 254, 255]));
    }

    #[test]
    fn wrong_messages_get_the_makers_texts() {
        let cases = [
            ("{", "Invalid JSON format"),
            ("[]", "No 'cmd' field found in JSON"),
            (r#"{"cmd":1}"#, "Missing cmd parameter"),
            (r#"{"cmd":"jump"}"#, "Unknown command"),
            (r#"{"cmd":"read","id":250,"num":7}"#, "Invalid id or num range"),
            (r#"{"cmd":"read","id":1}"#, "Missing id or num parameters for read command"),
            (r#"{"cmd":"write","id":11,"num":2,"value":[1]}"#, "Invalid id or num range"),
            (r#"{"cmd":"angle","id":7,"angle":80}"#, "Invalid id or angle value"),
            (r#"{"cmd":"angles","angles":[1]}"#, "angles array must have 7 elements, got 1"),
            (r#"{"cmd":"angles","angles":[0,0,0,0,0,0,181]}"#, "angles[6] = 181 is out of range [0, 180]"),
            (r#"{"cmd":"speed","speed":101}"#, "Invalid speed value (0-100)"),
            (r#"{"cmd":"vacuum"}"#, "Invalid vacuum status (0 or 1)"),
        ];
        for (text, message) in cases {
            let error = MakerCommand::parse(text).unwrap_err();
            assert_eq!((error.message.as_str(), error.is_read), (message, text.contains("read")), "{text}");
        }
    }
}
