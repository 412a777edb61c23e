//! Register values as text, from the register table: `-5 °`, `servo`, `joints 2 and 3`.

use protocol_core::registers::map::{
    BAUD_RATE, BLOCKED_JOINTS, CHIP_ID, EEPROM_LOCK, EFFECTOR_TYPE, FAULTS, FINE_POSITION, HOST_WATCHDOG,
    LAST_REFUSAL, LAST_REFUSED_REGISTER, LET_GO_JOINTS, LIMITS, MEASURED_JOINTS, MISSING_SERVOS, MOTOR_STATE,
    MOVING_JOINTS, PROTECTION, REPORT_CONTENT, SERVO_ALARMS, SET_POINT_PERIOD, SUPPLY_LOST, VACUUM_PUMP,
    WATCHDOG_ACTION, baud_rate, limit, motor_state, refusal, report_content,
};
use protocol_core::registers::map21::{
    DISC_DIRECTION, OPTIONS, PRESENT_LOAD, WRIST_POSITION, find_readable, option,
};
use protocol_core::registers::{Access, Joint, Range, Register, Unit};

use crate::health::{ALARM_BITS, FAULT_BITS};
use crate::map21_text;
use crate::names::name_of_register;
use crate::units::Speed;
use host_link::{Snapshot, Span};

/// The text of one value: of one register, or of several that belong together.
///
/// ```
/// use sevenbot::Snapshot;
///
/// let shown = sevenbot::register_text::entries(&Snapshot { address: 29, values: vec![1] });
/// assert_eq!(shown[0].name, "motor-state");
/// assert_eq!(shown[0].meaning, "servo");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RegisterEntry {
    /// The first register.
    pub address: u8,
    /// The name, as [`name_of_register`] gives it.
    pub name: String,
    /// The raw bytes, in the order of the registers.
    pub bytes: Vec<u8>,
    /// The number or numbers in the table's unit, as `sevenbot set` takes them; of raw bytes and a chip id, hexadecimal.
    pub value: String,
    /// The meaning of the number; may be empty.
    pub meaning: String,
}

/// The values of a snapshot as text. A value of several registers is one entry if the snapshot has all of them.
#[must_use]
pub fn entries(snapshot: &Snapshot) -> Vec<RegisterEntry> {
    let mut entries = Vec::new();
    let mut addresses = snapshot.span().addresses().peekable();
    while let Some(address) = addresses.next() {
        let Some((row, span)) = long_value(address, snapshot) else {
            entries.push(entry(address, snapshot.at(address)));
            continue;
        };
        entries.push(long_entry(row, span, snapshot));
        while addresses.next_if(|&next| span.addresses().any(|held| held == next)).is_some() {}
    }
    entries
}

/// The bytes of a snapshot as hexadecimal numbers, one entry each.
#[must_use]
pub fn raw_entries(snapshot: &Snapshot) -> Vec<RegisterEntry> {
    let pairs = snapshot.span().addresses().zip(&snapshot.values);
    let raw = |(address, byte): (u8, &u8)| RegisterEntry {
        value: format!("0x{byte:02X}"),
        ..entry(address, *byte)
    };
    pairs.map(raw).map(|entry| RegisterEntry { meaning: String::new(), ..entry }).collect()
}

/// The value of several registers that starts here, if the snapshot has all of them.
fn long_value(address: u8, snapshot: &Snapshot) -> Option<(&'static Register, Span)> {
    let row = find_readable(address).filter(|row| row.access != Access::Reserved)?;
    let span = match (row.range.width(), row.per_joint) {
        (2, _) => Span::new(address, 2).filter(|_| (address - row.address).is_multiple_of(2))?,
        (_, false) if row.count > 1 && address == row.address => Span::of(row),
        _ => return None,
    };
    let held = snapshot.span().addresses();
    span.addresses().all(|address| held.clone().any(|held| held == address)).then_some((row, span))
}

fn long_entry(row: &Register, span: Span, snapshot: &Snapshot) -> RegisterEntry {
    let bytes: Vec<u8> = span.addresses().map(|address| snapshot.at(address)).collect();
    let (value, meaning) = match (*row, bytes.as_slice()) {
        (CHIP_ID, _) => (bytes.iter().map(|byte| format!("{byte:02X}")).collect(), String::new()),
        (_, &[low, high]) if row.range.width() == 2 => {
            let word = u16::from_le_bytes([low, high]);
            (row.range.decode(word).to_string(), word_meaning(row, word))
        }
        (DISC_DIRECTION | WRIST_POSITION, _) => {
            let numbers: Vec<String> = bytes.iter().map(u8::to_string).collect();
            (numbers.join(" "), map21_text::values(row, &bytes))
        }
        _ => (snapshot.counter(row).to_string(), String::new()),
    };
    RegisterEntry { address: span.address(), name: name_of_register(span.address()), bytes, value, meaning }
}

/// The meaning of a two-byte value in a row; empty if the number is enough.
#[must_use]
pub fn word_meaning(row: &Register, word: u16) -> String {
    let number = f64::from(row.range.decode(word));
    match row.unit {
        Unit::Centidegree if *row == FINE_POSITION && word == u16::MAX => "not measured".to_owned(),
        Unit::Centidegree => format!("{:.2} °", number / 100.0),
        Unit::DecidegreePerSecond => format!("{:.1} °/s", number / 10.0),
        Unit::PermilleOfStall => format!("{:.1} %", number / 10.0),
        _ if *row == SET_POINT_PERIOD && word == 0 => "no stream".to_owned(),
        unit => unit.symbol().to_owned(),
    }
}

fn entry(address: u8, byte: u8) -> RegisterEntry {
    let row = find_readable(address);
    let value = row.map_or(i16::from(byte), |row| row.range.decode_byte(byte)).to_string();
    let meaning = row.map(|row| meaning(row, byte)).unwrap_or_default();
    RegisterEntry { address, name: name_of_register(address), bytes: vec![byte], value, meaning }
}

/// The meaning of a byte in a row; empty if the number is enough.
#[must_use]
pub fn meaning(row: &Register, byte: u8) -> String {
    match *row {
        BAUD_RATE => format!("{} baud", baud_rate(byte)),
        EEPROM_LOCK => (if byte == 0 { "open" } else { "locked" }).to_owned(),
        MOTOR_STATE => motor_state_name(byte).to_owned(),
        EFFECTOR_TYPE => (if byte == 0 { "suction cup" } else { "gripper" }).to_owned(),
        VACUUM_PUMP => (if byte == 0 { "release" } else { "suck" }).to_owned(),
        FAULTS => faults(byte),
        MISSING_SERVOS | MOVING_JOINTS | MEASURED_JOINTS | BLOCKED_JOINTS | LET_GO_JOINTS => joints(byte),
        PROTECTION => (if byte == 0 { "off" } else { "on" }).to_owned(),
        SERVO_ALARMS => servo_alarms(byte),
        SUPPLY_LOST => {
            (if byte == 0 { "no" } else { "yes: the motors are off until 29 is written" }).to_owned()
        }
        HOST_WATCHDOG if byte == 0 => "off".to_owned(),
        WATCHDOG_ACTION => (if byte == 0 { "hold" } else { "damping protection" }).to_owned(),
        LIMITS => limits(byte),
        REPORT_CONTENT => report_content_name(byte).to_owned(),
        LAST_REFUSAL => refusal_reason(byte).to_owned(),
        OPTIONS => options(byte),
        PRESENT_LOAD => format!("{:.1} %", 0.8 * (f64::from(byte) - 128.0)),
        // No refusal concerns register 0, the device code, so 0 means none.
        LAST_REFUSED_REGISTER if byte == 0 => "none".to_owned(),
        LAST_REFUSED_REGISTER => name_of_register(byte),
        _ => in_unit(row.unit, byte),
    }
}

fn in_unit(unit: Unit, byte: u8) -> String {
    let tenths = f64::from(byte) / 10.0;
    match unit {
        Unit::SpeedStep if byte == Speed::MAXIMUM.steps() => "maximum, 372 °/s".to_owned(),
        Unit::SpeedStep => Speed::from_steps(byte)
            .map_or_else(String::new, |speed| format!("{:.1} °/s", speed.degrees_per_second())),
        Unit::Centisecond => format!("{:.2} s", f64::from(byte) / 100.0),
        Unit::Decisecond => format!("{tenths:.1} s"),
        Unit::Decivolt if byte == 0 => "unknown".to_owned(),
        Unit::Decivolt => format!("{tenths:.1} V"),
        Unit::VersionTenths => format!("{tenths:.1}"),
        _ => unit.symbol().to_owned(),
    }
}

/// The name of a motor state.
#[must_use]
pub const fn motor_state_name(state: u8) -> &'static str {
    match state {
        motor_state::DAMPING => "damping protection",
        motor_state::SERVO => "servo",
        motor_state::FORCELESS => "forceless",
        _ => "unknown",
    }
}

/// The reason of the last refusal, for a value of register 244.
#[must_use]
pub const fn refusal_reason(reason: u8) -> &'static str {
    match reason {
        refusal::NONE => "none",
        refusal::MALFORMED_RANGE => "it reached past register 255",
        refusal::OUT_OF_RANGE => "a value was out of range",
        refusal::STORAGE_FULL => "the settings storage was full",
        refusal::HALF_A_WORD => "it held half of a two-byte register",
        refusal::AGAINST_A_LIMIT => "it was against a limit that is switched on",
        refusal::OUT_OF_REACH => "no joint angles reach the position",
        _ => "unknown",
    }
}

/// The names of the faults in these bits of register 241; `none` if no bit is set.
#[must_use]
pub fn faults(bits: u8) -> String {
    set_words(bits, &FAULT_BITS.map(|(bit, problem)| (bit, problem.name())))
}

/// The alarms of servos in these bits of register 197 ([D28](protocol_core::decisions#d28)); `none` if no bit is set.
#[must_use]
pub fn servo_alarms(bits: u8) -> String {
    set_words(bits, &ALARM_BITS.map(|(bit, problem)| (bit, problem.name())))
}

/// The words of the bits that are set, as a list.
fn set_words(bits: u8, words: &[(u8, &str)]) -> String {
    let set = words.iter().filter(|(bit, _)| bits & bit != 0).map(|&(_, word)| word.to_owned());
    list(set.collect()).unwrap_or_else(|| "none".to_owned())
}

/// The options in these bits of register 20 (M6).
fn options(bits: u8) -> String {
    let set = |bit, words: &str| (bits & bit != 0).then(|| words.to_owned());
    let biased = set(option::BIASED_OFFSETS, "offsets read as 128 + offset until the first write");
    let alarms = set(option::ALARMS, "alarm frames");
    list(biased.into_iter().chain(alarms).collect()).unwrap_or_else(|| "none".to_owned())
}

/// The names of the limits in these bits of register 188; `none` if no bit is set.
#[must_use]
pub fn limits(bits: u8) -> String {
    set_words(bits, &[(limit::LINKAGE, "linkage"), (limit::CLAW, "claw")])
}

const fn report_content_name(content: u8) -> &'static str {
    match content {
        report_content::FINE_POSITIONS => "positions in 0.01 °",
        report_content::FINE_STATE => "positions in 0.01 °, velocities and loads",
        _ => "positions",
    }
}

/// The joints in these bits, as `joints 2 and 3`; `none` if no bit is set.
#[must_use]
pub fn joints(bits: u8) -> String {
    let set = Joint::ALL.iter().filter(|joint| bits & joint.bit() != 0);
    let numbers: Vec<String> = set.map(|joint| joint.number().to_string()).collect();
    let noun = if numbers.len() == 1 { "joint" } else { "joints" };
    list(numbers).map_or_else(|| "none".to_owned(), |numbers| format!("{noun} {numbers}"))
}

fn list(mut words: Vec<String>) -> Option<String> {
    let last = words.pop()?;
    Some(if words.is_empty() { last } else { format!("{} and {last}", words.join(", ")) })
}

/// The range of the register at `address`, such as `0 to 180`; empty if the table has no register there.
#[must_use]
pub fn range(address: u8) -> String {
    find_readable(address).map_or_else(String::new, |row| match (row.range, row.range.bounds()) {
        (Range::ZeroOr(low, high), _) => format!("0, or {low} to {high}"),
        (_, (low, high)) => format!("{low} to {high}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::{FRAMES_ACCEPTED, OFFSET, SPEED, VELOCITY, fault};

    #[test]
    fn bits_are_shown_as_lists() {
        assert_eq!(joints(0), "none");
        assert_eq!(joints(0b100), "joint 3");
        assert_eq!(joints(0b110), "joints 2 and 3");
        assert_eq!(faults(fault::SERVO_BUS | fault::CRYSTAL_FAILED), "servo bus and crystal failed");
        assert_eq!(faults(0), "none");
    }

    #[test]
    fn complete_values_of_several_registers_are_one_entry() {
        let whole = Snapshot { address: 0, values: vec![7, 30, 0xAB, 0x46, 0xDB, 0xA5, 0x94, 0x95] };
        let shown = entries(&whole);
        assert_eq!(shown.len(), 3);
        assert_eq!((shown[2].name.as_str(), shown[2].value.as_str()), ("chip-id", "AB46DBA59495"));
        assert_eq!(shown[1].meaning, "3.0");
        let part = Snapshot { address: 3, values: vec![0x46, 0xDB] };
        let names: Vec<String> = entries(&part).into_iter().map(|entry| entry.name).collect();
        assert_eq!(names, ["chip-id+1", "chip-id+2"]);
        let counter = Snapshot { address: FRAMES_ACCEPTED.address, values: vec![0x34, 0x12, 5] };
        let values: Vec<String> = entries(&counter).into_iter().map(|entry| entry.value).collect();
        assert_eq!(values, ["4660", "5"]);
    }

    #[test]
    fn d22_words_are_one_entry_each() {
        let snapshot = Snapshot { address: 127, values: vec![0, 0x28, 0x23, 1] };
        let shown: Vec<_> =
            entries(&snapshot).into_iter().map(|entry| (entry.name, entry.value, entry.meaning)).collect();
        let expected = [
            ("register 127", "0", ""),
            ("fine-target.1", "9000", "90.00 °"),
            ("fine-target.2", "1", "× 0.01 °"),
        ];
        assert_eq!(shown, expected.map(|(name, value, meaning)| (name.into(), value.into(), meaning.into())));
        assert_eq!(word_meaning(&FINE_POSITION, 0xFFFF), "not measured");
        assert_eq!(word_meaning(&VELOCITY, 0xFFFB), "-0.5 °/s");
        assert_eq!([limits(3), limits(0)], ["linkage and claw", "none"]);
        assert_eq!(meaning(&HOST_WATCHDOG, 25), "0.25 s");
    }

    #[test]
    fn registers_of_map_21_have_a_meaning() {
        assert_eq!(meaning(&OPTIONS, 0), "none");
        assert_eq!(meaning(&OPTIONS, 2), "alarm frames");
        assert_eq!(
            meaning(&OPTIONS, 3),
            "offsets read as 128 + offset until the first write and alarm frames"
        );
        assert_eq!(meaning(&PRESENT_LOAD, 93), "-28.0 %");
        let shown =
            entries(&Snapshot { address: 63, values: vec![128, 129, 127, 0, 0, 4, 100, 4, 200, 4, 150] });
        let [disc, .., wrist] = shown.as_slice() else { panic!("{shown:?}") };
        assert_eq!((disc.value.as_str(), disc.meaning.as_str()), ("128 129 127", "0 1 -1"));
        assert_eq!((wrist.value.as_str(), wrist.meaning.as_str()), ("4 100 4 200 4 150", "100 200 150 mm"));
    }

    #[test]
    fn values_have_the_units_of_the_table() {
        assert_eq!(entry(OFFSET.address, 0x85).value, "-5");
        assert_eq!(entry(OFFSET.address, 0x85).meaning, "°");
        assert_eq!(meaning(&SPEED, 60), "114.0 °/s");
        assert_eq!(meaning(&SPEED, 0), "maximum, 372 °/s");
        let raw = raw_entries(&Snapshot { address: OFFSET.address, values: vec![0x85] });
        assert_eq!(raw[0].value, "0x85");
    }
}
