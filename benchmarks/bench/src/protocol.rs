//! Frames of each protocol for the same operation, built from the protocols' specifications with the `crc` crate.
//! Apart from that crate, which the postcard server uses too, none of the measured code is used. So the expected bytes are
//! independent of it.
//!
//! A Modbus register holds two bytes. An odd number of bytes is rounded up to whole registers: a write also carries
//! the current value of the byte that follows.

use crc::{CRC_16_MCRF4XX, CRC_16_MODBUS, Crc};
use peers::work::STATION;

use crate::operation::RegisterOperation;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
const MAVLINK_CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MCRF4XX);

/// Message id of MAVLink's TUNNEL, low byte first.
const TUNNEL: [u8; 3] = [0x81, 0x01, 0];
/// CRC_EXTRA of TUNNEL: the checksum of a message covers this byte at the end, but the message does not contain it.
const TUNNEL_CRC_EXTRA: u8 = 147;
/// MAVLink system and component of the host.
const HOST: [u8; 2] = [255, 190];
/// MAVLink system and component of the arm.
const ARM: [u8; 2] = [1, 1];

#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Protocol {
    /// This project's protocol.
    SevenBot,
    /// Modbus RTU, functions 3 and 16.
    ModbusRtu,
    /// postcard's serialisation and a CRC-16, encoded by COBS.
    Postcard,
    /// MAVLink 2: function, address, count and values in TUNNEL messages.
    Mavlink,
}

impl Protocol {
    /// The request for an operation. `registers` holds the values before the operation.
    pub(crate) fn request(self, operation: &RegisterOperation, registers: &[u8]) -> Vec<u8> {
        let &RegisterOperation { first, count, .. } = operation;
        let written = operation.written.as_slice();
        let is_read = operation.is_read();
        let function = if is_read { 3 } else { 6 };
        match self {
            Self::SevenBot => with_crc([&[0xAA, 0x77, function, first, count], written].concat()),
            Self::ModbusRtu => modbus_request(operation, registers),
            Self::Postcard if is_read => cobs(&with_crc(vec![0, first, count])),
            Self::Postcard => cobs(&with_crc([&[1, first, count], written].concat())),
            Self::Mavlink => tunnel(HOST, ARM, &[&[function, first, count], written].concat()),
        }
    }

    /// The reply to an operation; empty if the operation has no reply. `registers` holds the values after the operation.
    pub(crate) fn reply(self, operation: &RegisterOperation, registers: &[u8]) -> Vec<u8> {
        let &RegisterOperation { first, count, .. } = operation;
        let read = operation.values(registers, count);
        match self {
            Self::ModbusRtu => modbus_reply(operation, registers),
            _ if !operation.is_read() => Vec::new(),
            Self::SevenBot => with_crc([&[0xAA, 0x77, 3, first, count], read.as_slice()].concat()),
            Self::Postcard => cobs(&with_crc([&[first, count], read.as_slice()].concat())),
            Self::Mavlink => tunnel(ARM, HOST, &[&[3, first, count], read.as_slice()].concat()),
        }
    }
}

/// The first Modbus register of an operation, and the number of registers. The first byte has an even address.
const fn modbus_registers(operation: &RegisterOperation) -> (u8, u8) {
    (operation.first / 2, operation.count.div_ceil(2))
}

fn modbus_request(operation: &RegisterOperation, registers: &[u8]) -> Vec<u8> {
    let (first, count) = modbus_registers(operation);
    if operation.is_read() {
        return with_crc(vec![STATION, 3, 0, first, 0, count]);
    }
    let mut values = operation.values(registers, 2 * count);
    for (value, &written) in values.iter_mut().zip(&operation.written) {
        *value = written;
    }
    with_crc([&[STATION, 16, 0, first, 0, count, 2 * count], values.as_slice()].concat())
}

fn modbus_reply(operation: &RegisterOperation, registers: &[u8]) -> Vec<u8> {
    let (first, count) = modbus_registers(operation);
    if !operation.is_read() {
        return with_crc(vec![STATION, 16, 0, first, 0, count]);
    }
    let values = operation.values(registers, 2 * count);
    with_crc([&[STATION, 3, 2 * count], values.as_slice()].concat())
}

/// Appends the CRC, low byte first.
fn with_crc(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

/// COBS: the distance to the next zero replaces each zero, and a zero ends the frame. Runs without a zero are shorter
/// than 254 bytes here.
fn cobs(bytes: &[u8]) -> Vec<u8> {
    let runs = bytes.split(|&byte| byte == 0);
    let mut frame: Vec<u8> = runs.flat_map(|bytes| [&[length(bytes) + 1], bytes].concat()).collect();
    frame.push(0);
    frame
}

/// A TUNNEL message. MAVLink 2 does not send the zeros at the end of a payload.
fn tunnel(from: [u8; 2], to: [u8; 2], data: &[u8]) -> Vec<u8> {
    let payload = [&[0, 0, to[0], to[1], length(data)], data].concat();
    let kept = payload.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1);
    let payload = payload.get(..kept).unwrap_or(&[]);
    let header = [length(payload), 0, 0, 0, from[0], from[1], TUNNEL[0], TUNNEL[1], TUNNEL[2]];
    let checked = [&header, payload].concat();
    let crc = MAVLINK_CRC.checksum(&[checked.as_slice(), &[TUNNEL_CRC_EXTRA]].concat());
    [&[0xFD], checked.as_slice(), &crc.to_le_bytes()].concat()
}

/// The length as one byte. All frames here are shorter than 256 bytes.
fn length(bytes: &[u8]) -> u8 {
    u8::try_from(bytes.len()).unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use peers::work::{MAVLINK, MODBUS_RTU, POSTCARD, Requests, SEVEN_BOT, initial_values};

    use super::*;

    const POSE: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];

    /// Registers that hold [`POSE`] at 46 and 54, and 9 at 53.
    fn registers() -> [u8; 256] {
        let mut registers = initial_values();
        registers[46..53].copy_from_slice(&POSE);
        registers[53] = 9;
        registers[54..61].copy_from_slice(&POSE);
        registers
    }

    #[test]
    fn frames_match_the_specifications() {
        let registers = registers();
        let read = RegisterOperation::read(54, 7);
        let write = RegisterOperation::write(46, POSE.to_vec());
        assert_eq!(Protocol::SevenBot.request(&read, &registers), *b"\xaa\x77\x03\x36\x07\x81\xce");
        assert_eq!(Protocol::SevenBot.request(&write, &registers), *b"\xaa\x77\x06\x2e\x07ZZAZZZP\xf9\x91");
        assert_eq!(Protocol::SevenBot.reply(&read, &registers), *b"\xaa\x77\x03\x36\x07ZZAZZZP\x43\x81");
        let twenty = RegisterOperation::read(0, 20);
        assert_eq!(Protocol::ModbusRtu.request(&twenty, &registers), [1, 3, 0, 0, 0, 10, 0xC5, 0xCD]);
    }

    #[test]
    fn modbus_carries_seven_bytes_in_four_registers() {
        let registers = registers();
        let read = RegisterOperation::read(46, 7);
        assert_eq!(Protocol::ModbusRtu.request(&read, &registers)[..6], [1, 3, 0, 23, 0, 4]);
        let reply = Protocol::ModbusRtu.reply(&read, &registers);
        assert_eq!(reply[..reply.len() - 2], *b"\x01\x03\x08ZZAZZZP\x09");
        let write = RegisterOperation::write(46, vec![1, 2, 3, 4, 5, 6, 7]);
        let request = Protocol::ModbusRtu.request(&write, &registers);
        assert_eq!(request[..request.len() - 2], [1, 16, 0, 23, 0, 4, 8, 1, 2, 3, 4, 5, 6, 7, 9]);
        assert_eq!(Protocol::ModbusRtu.reply(&write, &registers)[..6], [1, 16, 0, 23, 0, 4]);
    }

    #[test]
    fn cobs_leaves_one_zero() {
        // Examples of the paper that describes COBS (Cheshire and Baker), and an empty frame.
        assert_eq!(cobs(&[0]), [1, 1, 0]);
        assert_eq!(cobs(&[0x11, 0x22, 0, 0x33]), [3, 0x11, 0x22, 2, 0x33, 0]);
        assert_eq!(cobs(&[]), [1, 0]);
    }

    #[test]
    fn requests_counted_on_the_chip_equal_those_timed_here() {
        let registers = initial_values();
        let check = |protocol: Protocol, requests: Requests| {
            assert_eq!(protocol.request(&RegisterOperation::read(46, 7), &registers), requests.read_of_7);
            let write = RegisterOperation::write(46, POSE.to_vec());
            assert_eq!(protocol.request(&write, &registers), requests.write_of_7);
            assert_eq!(protocol.request(&RegisterOperation::read(0, 61), &registers), requests.read_of_61);
        };
        check(Protocol::SevenBot, SEVEN_BOT);
        check(Protocol::ModbusRtu, MODBUS_RTU);
        check(Protocol::Postcard, POSTCARD);
        check(Protocol::Mavlink, MAVLINK);
    }
}
