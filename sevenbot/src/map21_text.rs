//! Values of the registers that only map 2.1 has, in words: `-50 185 50 mm`.

use protocol_core::registers::Register;
use protocol_core::registers::map21::{
    DISC_DIRECTION, PRESENT_LOAD, TIP_POSITION, TOOL_DIRECTION, WRIST_POSITION,
};

/// The bytes of a row, or of a part of it, as numbers with their unit.
pub(crate) fn values(row: &Register, bytes: &[u8]) -> String {
    let numbers: Vec<String> = match (*row, bytes) {
        (TIP_POSITION | WRIST_POSITION, &[x1, x0, y1, y0, z1, z0]) => {
            let millimetres =
                [[x1, x0], [y1, y0], [z1, z0]].map(|pair| i32::from(u16::from_be_bytes(pair)) - 1024);
            let [x, y, z] = millimetres;
            return format!("{x} {y} {z} mm");
        }
        (TOOL_DIRECTION | DISC_DIRECTION | PRESENT_LOAD, _) => {
            bytes.iter().map(|&byte| (i16::from(byte) - 128).to_string()).collect()
        }
        _ => bytes.iter().map(|&byte| row.range.decode_byte(byte).to_string()).collect(),
    };
    format!("{} {}", numbers.join(" "), row.unit.symbol()).trim_end().to_owned()
}
