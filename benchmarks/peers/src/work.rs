//! The register values that all servers start with, and the requests whose instructions are counted in the emulator, as
//! literal bytes.
//!
//! A Modbus register holds two bytes. Modbus register `n` holds bytes `2n` (high) and `2n + 1` (low) of the register
//! map, so all servers hold the same 256 bytes.

use protocol_core::registers::RegisterFile;

/// The address of the Modbus station.
pub const STATION: u8 = 1;

/// The register values that every server starts with.
#[must_use]
pub fn initial_values() -> [u8; 256] {
    let file = RegisterFile::new([1, 2, 3, 4, 5, 6], None);
    let mut values = [0; 256];
    for (value, address) in values.iter_mut().zip(0..=u8::MAX) {
        *value = file.get(address);
    }
    values
}

/// The number of registers of a Modbus server.
pub const REGISTERS: usize = 128;

/// The values of [`initial_values`] as the registers of a Modbus server, two bytes in each.
#[must_use]
pub fn initial_words() -> [u16; REGISTERS] {
    let values = initial_values();
    let mut words = [0; REGISTERS];
    for (word, &bytes) in words.iter_mut().zip(values.as_chunks().0) {
        *word = u16::from_be_bytes(bytes);
    }
    words
}

/// The three requests that are counted, in one protocol.
#[derive(Clone, Copy)]
pub struct Requests {
    /// A read of bytes 46 to 52 of the register map; 46 to 53 in Modbus.
    pub read_of_7: &'static [u8],
    /// A write of 90 90 65 90 90 90 80 to bytes 46 to 52; in Modbus also 0 to byte 53.
    pub write_of_7: &'static [u8],
    /// A read of bytes 0 to 60; 0 to 61 in Modbus.
    pub read_of_61: &'static [u8],
}

/// This project's protocol, functions 3 and 6.
pub const SEVEN_BOT: Requests = Requests {
    read_of_7: b"\xaa\x77\x03\x2e\x07\x8b\xce",
    write_of_7: b"\xaa\x77\x06\x2e\x07\x5a\x5a\x41\x5a\x5a\x5a\x50\xf9\x91",
    read_of_61: b"\xaa\x77\x03\x00\x3d\x16\x7d",
};

/// Modbus RTU, functions 3 and 16, on 4 and 31 registers.
pub const MODBUS_RTU: Requests = Requests {
    read_of_7: b"\x01\x03\x00\x17\x00\x04\xf4\x0d",
    write_of_7: b"\x01\x10\x00\x17\x00\x04\x08\x5a\x5a\x41\x5a\x5a\x5a\x50\x00\xa4\xdf",
    read_of_61: b"\x01\x03\x00\x00\x00\x1f\x04\x02",
};

/// postcard, CRC-16 and COBS.
pub const POSTCARD: Requests = Requests {
    read_of_7: b"\x01\x05\x2e\x07\x2d\xa2\x00",
    write_of_7: b"\x0d\x01\x2e\x07\x5a\x5a\x41\x5a\x5a\x5a\x50\x77\x22\x00",
    read_of_61: b"\x01\x01\x04\x3d\xb0\x11\x00",
};

/// MAVLink 2, messages TUNNEL from 255.190 to 1.1.
pub const MAVLINK: Requests = Requests {
    read_of_7: b"\xfd\x08\x00\x00\x00\xff\xbe\x81\x01\x00\x00\x00\x01\x01\x03\x03\x2e\x07\x45\x3f",
    write_of_7:
        b"\xfd\x0f\x00\x00\x00\xff\xbe\x81\x01\x00\x00\x00\x01\x01\x0a\x06\x2e\x07\x5a\x5a\x41\x5a\x5a\x5a\x50\x9c\x7e",
    read_of_61: b"\xfd\x08\x00\x00\x00\xff\xbe\x81\x01\x00\x00\x00\x01\x01\x03\x03\x00\x3d\xb7\x67",
};
