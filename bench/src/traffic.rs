//! The operations of each case, and the replies that a model of the registers expects: nothing that is measured
//! has a say in what is right. Knows no frame.

use bench_servers::work::initial_values;
use protocol_core::registers::map::TARGET_POSITION;

use crate::protocol::Protocol;

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
    /// `count` requests of a case. The same operations, and the same requests damaged, in every protocol.
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
                traffic.replies.extend(protocol.reply(&operation, &operation.values_read(&values)));
                traffic.undamaged += 1;
            }
            traffic.requests.extend(request);
        }
        traffic
    }
}

/// What one request asks for.
pub(crate) struct Operation {
    /// The first register.
    pub(crate) first: u8,
    /// How many.
    pub(crate) count: u8,
    /// Empty in a read.
    pub(crate) written: Vec<u8>,
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
