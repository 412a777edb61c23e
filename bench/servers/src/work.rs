//! The registers that all servers start with, and the requests that are counted on the chip, as literal bytes.

use protocol_core::registers::RegisterFile;

/// The Modbus station that is asked.
pub const STATION: u8 = 1;

/// Values of the registers at the start, the same for all.
#[must_use]
pub fn initial_values() -> [u8; 256] {
    let file = RegisterFile::new([1, 2, 3, 4, 5, 6], None);
    let mut values = [0; 256];
    for (value, address) in values.iter_mut().zip(0..=u8::MAX) {
        *value = file.get(address);
    }
    values
}

/// The registers a Modbus server starts with: the same numbers.
#[must_use]
pub fn initial_words() -> [u16; 256] {
    initial_values().map(u16::from)
}

/// The same three requests, as one protocol has them.
#[derive(Clone, Copy)]
pub struct Requests {
    /// A read of registers 46 to 52.
    pub read_of_7: &'static [u8],
    /// A write of 90 90 65 90 90 90 80 to them.
    pub write_of_7: &'static [u8],
    /// A read of registers 0 to 60.
    pub read_of_61: &'static [u8],
}

/// This project's protocol.
pub const SEVEN_BOT: Requests = Requests {
    read_of_7: b"\xaa\x77\x03\x2e\x07\x8b\xce",
    write_of_7: b"\xaa\x77\x06\x2e\x07\x5a\x5a\x41\x5a\x5a\x5a\x50\xf9\x91",
    read_of_61: b"\xaa\x77\x03\x00\x3d\x16\x7d",
};

/// Modbus RTU, functions 3 and 16.
pub const MODBUS_RTU: Requests = Requests {
    read_of_7: b"\x01\x03\x00\x2e\x00\x07\x64\x01",
    write_of_7:
        b"\x01\x10\x00\x2e\x00\x07\x0e\x00\x5a\x00\x5a\x00\x41\x00\x5a\x00\x5a\x00\x5a\x00\x50\x2a\xb9",
    read_of_61: b"\x01\x03\x00\x00\x00\x3d\x84\x1b",
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
