//! The same operations as frames of each protocol, built from the protocols' descriptions with the `crc` crate:
//! nothing that is measured has a say in what is right. Knows no registers.

use bench_servers::work::STATION;
use crc::{CRC_16_MCRF4XX, CRC_16_MODBUS, Crc};

use crate::traffic::Operation;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);
const MAVLINK_CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MCRF4XX);

/// MAVLink: the message TUNNEL, and the byte its checksum ends with, which stands for its fields.
const TUNNEL: [u8; 3] = [0x81, 0x01, 0];
/// See above.
const TUNNEL_SEED: u8 = 147;
/// MAVLink: system and component of who asks and who answers.
const HOST: [u8; 2] = [255, 190];
/// See above.
const ARM: [u8; 2] = [1, 1];

/// Which frames go over the line.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Protocol {
    SevenBot,
    ModbusRtu,
    /// Postcard's serialisation, a CRC-16 behind it, stuffed by COBS.
    Postcard,
    /// MAVLink 2: function, address, count and values inside TUNNEL messages.
    Mavlink,
}

impl Protocol {
    pub(crate) fn request(self, operation: &Operation) -> Vec<u8> {
        let &Operation { first, count, .. } = operation;
        let written = operation.written.as_slice();
        let is_read = written.is_empty();
        let function = if is_read { 3 } else { 6 };
        match self {
            Self::SevenBot => framed([&[0xAA, 0x77, function, first, count], written].concat()),
            Self::ModbusRtu if is_read => framed(vec![STATION, 3, 0, first, 0, count]),
            Self::ModbusRtu => {
                framed([&[STATION, 16, 0, first, 0, count, 2 * count], words(written).as_slice()].concat())
            }
            Self::Postcard if is_read => stuffed(&framed(vec![0, first, count])),
            Self::Postcard => stuffed(&framed([&[1, first, count], written].concat())),
            Self::Mavlink => tunnel(HOST, ARM, &[&[function, first, count], written].concat()),
        }
    }

    /// `read` is what the registers hold that are asked for.
    pub(crate) fn reply(self, operation: &Operation, read: &[u8]) -> Vec<u8> {
        let &Operation { first, count, .. } = operation;
        let is_read = operation.written.is_empty();
        match self {
            Self::ModbusRtu if is_read => framed([&[STATION, 3, 2 * count], words(read).as_slice()].concat()),
            Self::ModbusRtu => framed(vec![STATION, 16, 0, first, 0, count]),
            _ if !is_read => Vec::new(),
            Self::SevenBot => framed([&[0xAA, 0x77, 3, first, count], read].concat()),
            Self::Postcard => stuffed(&framed([&[first, count], read].concat())),
            Self::Mavlink => tunnel(ARM, HOST, &[&[3, first, count], read].concat()),
        }
    }
}

/// The bytes with their CRC behind them, low byte first.
fn framed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

fn words(bytes: &[u8]) -> Vec<u8> {
    bytes.iter().flat_map(|&byte| [0, byte]).collect()
}

/// COBS: each zero gives way to how far it is to the next, and one ends the frame. Stretches without a zero are
/// shorter than 254 bytes here.
fn stuffed(bytes: &[u8]) -> Vec<u8> {
    let stretches = bytes.split(|&byte| byte == 0);
    let mut frame: Vec<u8> = stretches.flat_map(|bytes| [&[length(bytes) + 1], bytes].concat()).collect();
    frame.push(0);
    frame
}

/// A TUNNEL message. Zeros at the end of a payload are not sent.
fn tunnel(from: [u8; 2], to: [u8; 2], data: &[u8]) -> Vec<u8> {
    let payload = [&[0, 0, to[0], to[1], length(data)], data].concat();
    let kept = payload.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1);
    let payload = payload.get(..kept).unwrap_or(&[]);
    let header = [length(payload), 0, 0, 0, from[0], from[1], TUNNEL[0], TUNNEL[1], TUNNEL[2]];
    let checked = [&header, payload].concat();
    let crc = MAVLINK_CRC.checksum(&[checked.as_slice(), &[TUNNEL_SEED]].concat());
    [&[0xFD], checked.as_slice(), &crc.to_le_bytes()].concat()
}

/// No frame here is longer than a byte can say.
fn length(bytes: &[u8]) -> u8 {
    u8::try_from(bytes.len()).unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use bench_servers::work::{MAVLINK, MODBUS_RTU, POSTCARD, SEVEN_BOT};

    use super::*;

    const POSE: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];

    fn operation(first: u8, count: u8, written: &[u8]) -> Operation {
        Operation { first, count, written: written.to_vec() }
    }

    #[test]
    fn frames_are_those_of_the_protocols() {
        let read = operation(54, 7, &[]);
        let write = operation(46, 7, &POSE);
        assert_eq!(Protocol::SevenBot.request(&read), *b"\xaa\x77\x03\x36\x07\x81\xce");
        assert_eq!(Protocol::SevenBot.request(&write), *b"\xaa\x77\x06\x2e\x07ZZAZZZP\xf9\x91");
        assert_eq!(Protocol::SevenBot.reply(&read, &POSE), *b"\xaa\x77\x03\x36\x07ZZAZZZP\x43\x81");
        let ten = operation(0, 10, &[]);
        assert_eq!(Protocol::ModbusRtu.request(&ten), [1, 3, 0, 0, 0, 10, 0xC5, 0xCD]);
        assert_eq!(Protocol::ModbusRtu.reply(&write, &[])[..6], [1, 16, 0, 46, 0, 7]);
    }

    #[test]
    fn stuffing_leaves_one_zero() {
        // The examples of the paper that describes COBS (Cheshire and Baker), and an empty frame.
        assert_eq!(stuffed(&[0]), [1, 1, 0]);
        assert_eq!(stuffed(&[0x11, 0x22, 0, 0x33]), [3, 0x11, 0x22, 2, 0x33, 0]);
        assert_eq!(stuffed(&[]), [1, 0]);
    }

    #[test]
    fn requests_counted_on_the_chip_are_those_timed_here() {
        for (protocol, requests) in [
            (Protocol::SevenBot, SEVEN_BOT),
            (Protocol::ModbusRtu, MODBUS_RTU),
            (Protocol::Postcard, POSTCARD),
            (Protocol::Mavlink, MAVLINK),
        ] {
            assert_eq!(protocol.request(&operation(46, 7, &[])), requests.read_of_7);
            assert_eq!(protocol.request(&operation(46, 7, &POSE)), requests.write_of_7);
            assert_eq!(protocol.request(&operation(0, 61, &[])), requests.read_of_61);
        }
    }
}
