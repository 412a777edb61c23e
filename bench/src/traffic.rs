//! The operations of each case, as frames of either protocol, and the replies that a model of the registers
//! expects. Frames are built here from the protocols' descriptions, with the `crc` crate: nothing that is
//! measured has a say in what is right.

use bench_servers::work::{STATION, initial_values};
use crc::{CRC_16_MODBUS, Crc};
use protocol_core::registers::map::TARGET_POSITION;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// One row of the table.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    /// The operation for a number below 10, each as likely.
    operation: fn(u8) -> Kind,
    /// How many requests in a thousand are damaged.
    damaged_per_mille: u64,
}

/// What is measured.
pub(crate) const CASES: &[Case] = &[
    Case { name: "read of 7", operation: |_| Kind::ReadJoints, damaged_per_mille: 0 },
    Case { name: "write of 7", operation: |_| Kind::WriteJoints, damaged_per_mille: 0 },
    Case { name: "read of 61", operation: |_| Kind::ReadAll, damaged_per_mille: 0 },
    Case { name: "mix", operation: mix, damaged_per_mille: 0 },
    Case { name: "mix, 1 % damaged", operation: mix, damaged_per_mille: 10 },
];

/// A host that steers by what it sees: half reads of seven, four tenths writes of seven, now and then all.
const fn mix(number: u8) -> Kind {
    match number {
        0..5 => Kind::ReadJoints,
        5..9 => Kind::WriteJoints,
        _ => Kind::ReadAll,
    }
}

#[derive(Clone, Copy)]
enum Kind {
    ReadJoints,
    WriteJoints,
    ReadAll,
}

/// Which frames go over the line.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Protocol {
    SevenBot,
    ModbusRtu,
}

/// A stream of requests, and what becomes of it.
pub(crate) struct Traffic {
    /// All requests, one behind the other.
    pub(crate) requests: Vec<u8>,
    /// The replies to those that were not damaged.
    pub(crate) replies: Vec<u8>,
    /// How many were not damaged.
    pub(crate) undamaged: usize,
}

impl Traffic {
    /// `count` requests of a case. The same operations, and the same requests damaged, in either protocol.
    pub(crate) fn new(case: &Case, protocol: Protocol, count: usize) -> Self {
        let mut traffic = Self { requests: Vec::new(), replies: Vec::new(), undamaged: 0 };
        let mut values = initial_values();
        let mut dice = Dice(0x7B07);
        for _ in 0..count {
            let operation = Operation::new((case.operation)(dice.below(10)), &mut dice);
            let damage = (dice.next() % 1000 < case.damaged_per_mille).then(|| dice.next());
            let mut request = protocol.request(&operation);
            if let Some(damage) = damage {
                flip(&mut request, damage);
            } else {
                operation.carry_out(&mut values);
                traffic.replies.extend(protocol.reply(&operation, &values));
                traffic.undamaged += 1;
            }
            traffic.requests.extend(request);
        }
        traffic
    }
}

/// What one request asks for.
struct Operation {
    first: u8,
    count: u8,
    /// Empty in a read.
    written: Vec<u8>,
}

impl Operation {
    fn new(kind: Kind, dice: &mut Dice) -> Self {
        let joints = TARGET_POSITION;
        let written = match kind {
            Kind::WriteJoints => (0..joints.count).map(|_| dice.below(181)).collect(),
            Kind::ReadJoints | Kind::ReadAll => Vec::new(),
        };
        match kind {
            Kind::ReadAll => Self { first: 0, count: 61, written },
            Kind::ReadJoints | Kind::WriteJoints => {
                Self { first: joints.address, count: joints.count, written }
            }
        }
    }

    fn carry_out(&self, values: &mut [u8]) {
        for (place, &value) in values.iter_mut().skip(usize::from(self.first)).zip(&self.written) {
            *place = value;
        }
    }

    fn values_read(&self, values: &[u8]) -> Vec<u8> {
        values.iter().skip(usize::from(self.first)).take(usize::from(self.count)).copied().collect()
    }
}

impl Protocol {
    fn request(self, operation: &Operation) -> Vec<u8> {
        let &Operation { first, count, .. } = operation;
        let written = operation.written.as_slice();
        let function = if written.is_empty() { 3 } else { 6 };
        match self {
            Self::SevenBot => framed([&[0xAA, 0x77, function, first, count], written].concat()),
            Self::ModbusRtu if written.is_empty() => framed(vec![STATION, 3, 0, first, 0, count]),
            Self::ModbusRtu => {
                framed([&[STATION, 16, 0, first, 0, count, 2 * count], words(written).as_slice()].concat())
            }
        }
    }

    fn reply(self, operation: &Operation, values: &[u8]) -> Vec<u8> {
        let &Operation { first, count, .. } = operation;
        let read = operation.values_read(values);
        match (self, operation.written.is_empty()) {
            (Self::SevenBot, true) => framed([&[0xAA, 0x77, 3, first, count], read.as_slice()].concat()),
            (Self::SevenBot, false) => Vec::new(),
            (Self::ModbusRtu, true) => framed([&[STATION, 3, 2 * count], words(&read).as_slice()].concat()),
            (Self::ModbusRtu, false) => framed(vec![STATION, 16, 0, first, 0, count]),
        }
    }
}

/// The bytes with their CRC behind them, low byte first: both protocols have the same.
fn framed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

fn words(bytes: &[u8]) -> Vec<u8> {
    bytes.iter().flat_map(|&byte| [0, byte]).collect()
}

/// Changes one byte.
fn flip(frame: &mut [u8], damage: u64) {
    let [place, bits, ..] = damage.to_le_bytes();
    let place = usize::from(place) % frame.len().max(1);
    if let Some(byte) = frame.get_mut(place) {
        *byte ^= bits.max(1);
    }
}

/// Numbers without a pattern, the same in every run (splitmix64).
struct Dice(u64);

impl Dice {
    const fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    fn below(&mut self, limit: u8) -> u8 {
        let [byte, ..] = (self.next() % u64::from(limit.max(1))).to_le_bytes();
        byte
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bench_servers::work::{MODBUS_RTU, SEVEN_BOT};

    #[test]
    fn frames_are_those_of_the_protocols() {
        let read = Operation { first: 54, count: 7, written: Vec::new() };
        let pose = [90, 90, 65, 90, 90, 90, 80];
        let write = Operation { first: 46, count: 7, written: pose.to_vec() };
        assert_eq!(Protocol::SevenBot.request(&read), *b"\xaa\x77\x03\x36\x07\x81\xce");
        assert_eq!(Protocol::SevenBot.request(&write), *b"\xaa\x77\x06\x2e\x07ZZAZZZP\xf9\x91");
        let mut values = initial_values();
        values[54..61].copy_from_slice(&pose);
        assert_eq!(Protocol::SevenBot.reply(&read, &values), *b"\xaa\x77\x03\x36\x07ZZAZZZP\x43\x81");
        let ten = Operation { first: 0, count: 10, written: Vec::new() };
        assert_eq!(Protocol::ModbusRtu.request(&ten), [1, 3, 0, 0, 0, 10, 0xC5, 0xCD]);
        assert_eq!(Protocol::ModbusRtu.reply(&write, &values)[..6], [1, 16, 0, 46, 0, 7]);
    }
    #[test]
    fn requests_counted_on_the_chip_are_those_timed_here() {
        let operation = |first, count, written: &[u8]| Operation { first, count, written: written.to_vec() };
        for (protocol, requests) in [(Protocol::SevenBot, SEVEN_BOT), (Protocol::ModbusRtu, MODBUS_RTU)] {
            assert_eq!(protocol.request(&operation(46, 7, &[])), requests.read_of_7);
            let pose = operation(46, 7, &[90, 90, 65, 90, 90, 90, 80]);
            assert_eq!(protocol.request(&pose), requests.write_of_7);
            assert_eq!(protocol.request(&operation(0, 61, &[])), requests.read_of_61);
        }
    }
}
