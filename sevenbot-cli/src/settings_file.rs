//! A TOML file with the settings of an arm: names and units of the register table.
//!
//! ```toml
//! format = 1
//! chip-id = "53494D000001"
//! firmware = "3.0"
//!
//! [settings]
//! device-id = 42
//! baud-rate = 115200
//! offset = [0, -5, 0, 0, 0, 0, 0]
//! options = 0
//! ```
//!
//! Settings are the writable registers that keep their value without power. An arm with the maker's firmware has no options.

use std::io::{self, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use sevenbot::map::{BAUD_RATE, BAUD_RATES, baud_rate};
use sevenbot::names::{name_of, name_of_register};
use sevenbot::table::settings;
use sevenbot::{Arm, Register, Snapshot, Span, register_text};
use toml::{Table, Value};

use crate::command_error::CommandError;
use crate::input_file;
use crate::printer::Printable;

/// The version of the file format. Other versions are refused.
const FORMAT: u32 = 1;

/// Advice about a wrong setting.
const REMEDY: &str = "correct the line or delete it, or write a new file with `sevenbot backup FILE`";

/// The length limit of a settings file, in bytes. Real files are much shorter.
const LONGEST: u64 = 1_000_000;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct SettingsFile {
    format: u32,
    /// The chip id of the arm, see [`sevenbot::Identity::chip_name`].
    pub(crate) chip_id: String,
    firmware: String,
    settings: Table,
}

/// All registers from the first setting to the last.
pub(crate) fn span() -> Span {
    match (settings().next(), settings().last()) {
        (Some(first), Some(last)) => Span::between(first, last),
        _ => Span::NONE,
    }
}

impl SettingsFile {
    /// The settings of an arm, from its registers.
    pub(crate) fn of(arm: &Arm, registers: &Snapshot) -> Self {
        let rows = settings().filter(|row| arm.serves(row.address));
        let settings = rows.map(|row| (name_of(row), value(row, registers))).collect();
        let identity = arm.identity();
        Self { format: FORMAT, chip_id: identity.chip_name(), firmware: identity.version(), settings }
    }

    pub(crate) fn text(&self) -> io::Result<String> {
        let body = toml::to_string(self).map_err(io::Error::other)?;
        Ok(format!(
            "# Settings of a 7Bot V2. `sevenbot restore FILE` writes them back; missing settings keep their \
             value.\n{body}"
        ))
    }

    /// Reads a file of this format, shorter than [`LONGEST`] bytes.
    pub(crate) fn read(path: &Path) -> Result<Self, CommandError> {
        let text = input_file::short_text(path, LONGEST)?;
        let file: Self = toml::from_str(&text).map_err(|error| {
            CommandError::file(path, format!("this is no settings file of `sevenbot backup`: {error}"))
        })?;
        if file.format == FORMAT {
            Ok(file)
        } else {
            Err(CommandError::file(
                path,
                format!("its format is {}; this program reads format {FORMAT}", file.format),
            ))
        }
    }

    /// Applies the settings of the file to the registers `now`. Skips the settings for which `serves` is false, because the
    /// arm does not have them, and returns them.
    pub(crate) fn applied_to(
        &self,
        path: &Path,
        now: &Snapshot,
        serves: impl Fn(u8) -> bool,
    ) -> Result<(Snapshot, Vec<&'static Register>), CommandError> {
        let (mut wanted, mut missing) = (now.clone(), Vec::new());
        for (name, value) in &self.settings {
            let row = settings().find(|row| name_of(row) == *name);
            let row =
                row.ok_or_else(|| CommandError::file(path, format!("{name} is not a setting: {REMEDY}")))?;
            let bytes = bytes(row, value).map_err(|reason| CommandError::file(path, reason))?;
            if serves(row.address) {
                let places = (row.address..).zip(bytes);
                places.for_each(|(address, byte)| put(&mut wanted, address, byte));
            } else {
                missing.push(row);
            }
        }
        Ok((wanted, missing))
    }
}

impl Printable for SettingsFile {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(self.text()?.as_bytes())
    }
}

fn put(registers: &mut Snapshot, address: u8, byte: u8) {
    let place = usize::from(address.wrapping_sub(registers.address));
    if let Some(value) = registers.values.get_mut(place) {
        *value = byte;
    }
}

/// Converts the register values of a setting to its value in the file.
fn value(row: &Register, registers: &Snapshot) -> Value {
    let number = |address| Value::from(i64::from(row.range.decode_byte(registers.at(address))));
    match *row {
        BAUD_RATE => Value::from(i64::from(baud_rate(registers.byte(row)))),
        _ if row.per_joint => Value::Array(Span::of(row).addresses().map(number).collect()),
        _ => number(row.address),
    }
}

/// Converts the value of a setting in the file to its register values.
fn bytes(row: &Register, value: &Value) -> Result<Vec<u8>, String> {
    let values = value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice);
    if values.len() != usize::from(row.count) {
        let (name, count, given) = (name_of(row), row.count, values.len());
        return Err(format!("{name} has {given} values, not {count}: {REMEDY}"));
    }
    (row.address..).zip(values).map(|(address, value)| byte(row, address, value)).collect()
}

fn byte(row: &Register, address: u8, value: &Value) -> Result<u8, String> {
    let number = value.as_integer();
    if *row == BAUD_RATE {
        let code = BAUD_RATES.iter().zip(0..).find(|&(&rate, _)| number == Some(i64::from(rate)));
        return code.map(|(_, code)| code).ok_or_else(|| format!("the arm does not support {value} baud"));
    }
    let byte =
        number.and_then(|number| i16::try_from(number).ok()).and_then(|number| row.range.encode_byte(number));
    byte.ok_or_else(|| {
        format!(
            "{value} is out of range: {} takes {}",
            name_of_register(address),
            register_text::range(address)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sevenbot::map::DEVICE_ID;
    use sevenbot::map21::OPTIONS;

    fn registers() -> Snapshot {
        Snapshot { address: DEVICE_ID.address, values: vec![42, 3, 0, 0x85, 0, 0, 0, 0, 16, 2] }
    }

    fn file(settings: &str) -> SettingsFile {
        toml::from_str(&format!("format=1\nchip-id=''\nfirmware=''\n[settings]\n{settings}")).expect("TOML")
    }

    fn refused(settings: &str) -> String {
        match file(settings).applied_to(Path::new("x"), &registers(), |_| true) {
            Err(CommandError::File { reason, .. }) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn settings_are_stored_in_their_units() {
        let settings = settings().map(|row| (name_of(row), value(row, &registers()))).collect::<Table>();
        let text = toml::to_string(&settings).expect("TOML");
        assert_eq!(
            text,
            "baud-rate = 1000000\ndevice-id = 42\noffset = [0, -5, 0, 0, 0, 0, 16]\noptions = 2\n"
        );
        let new = Snapshot { values: vec![0; 10], ..registers() };
        let back = file(&text).applied_to(Path::new("x"), &new, |_| true);
        assert_eq!(back.expect("what was written is read"), (registers(), vec![]));
        let has_no_options = |address| address != OPTIONS.address;
        let (wanted, missing) =
            file(&text).applied_to(Path::new("x"), &new, has_no_options).expect("settings");
        assert_eq!((wanted.values, missing), (vec![42, 3, 0, 0x85, 0, 0, 0, 0, 16, 0], vec![&OPTIONS]));
    }

    #[test]
    fn settings_missing_in_the_file_keep_their_value() {
        let applied = file("device-id = 7").applied_to(Path::new("x"), &registers(), |_| true);
        let (wanted, _) = applied.expect("a setting");
        assert_eq!(wanted.values, [7, 3, 0, 0x85, 0, 0, 0, 0, 16, 2]);
    }

    #[test]
    fn unknown_names_and_values_out_of_range_are_refused() {
        assert_eq!(refused("speed = 5"), format!("speed is not a setting: {REMEDY}"));
        assert_eq!(
            refused("offset = [0, 17, 0, 0, 0, 0, 0]"),
            "17 is out of range: offset.2 takes -16 to 16"
        );
        assert_eq!(refused("offset = [1]"), format!("offset has 1 values, not 7: {REMEDY}"));
        assert_eq!(refused("device-id = 300"), "300 is out of range: device-id takes 0 to 255");
        assert_eq!(refused("device-id = 'x'").split(':').count(), 2);
        assert_eq!(refused("baud-rate = 5"), "the arm does not support 5 baud");
        assert_eq!(refused("options = 4"), "4 is out of range: options takes 0 to 3");
        assert_eq!(span(), Span::between(&DEVICE_ID, &OPTIONS));
    }
}
