//! The stream of requests of each case, and the replies that an independent model of the registers expects.

use fastrand::Rng;
use peers::work::initial_values;
use protocol_core::registers::map::TARGET_POSITION;

use crate::operation::RegisterOperation;
use crate::protocol::Protocol;

/// One row of the table.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    operation: fn(&mut Rng) -> RegisterOperation,
    damaged_per_mille: u32,
}

pub(crate) const CASES: &[Case] = &[
    Case { name: "read of 7", operation: read_joints, damaged_per_mille: 0 },
    Case { name: "write of 7", operation: write_joints, damaged_per_mille: 0 },
    Case { name: "read of 61", operation: read_all, damaged_per_mille: 0 },
    Case { name: "mix", operation: mix, damaged_per_mille: 0 },
    Case { name: "mix, 1 % damaged", operation: mix, damaged_per_mille: 10 },
];

// A Modbus register begins at an even byte.
const _: () = assert!(TARGET_POSITION.address.is_multiple_of(2));

const fn read_joints(_: &mut Rng) -> RegisterOperation {
    RegisterOperation::read(TARGET_POSITION.address, TARGET_POSITION.count)
}

fn write_joints(rng: &mut Rng) -> RegisterOperation {
    RegisterOperation::write(
        TARGET_POSITION.address,
        (0..TARGET_POSITION.count).map(|_| rng.u8(..=180)).collect(),
    )
}

const fn read_all(_: &mut Rng) -> RegisterOperation {
    RegisterOperation::read(0, 61)
}

/// A host in a control loop: 50 % reads of seven, 40 % writes of seven, 10 % reads of 61.
fn mix(rng: &mut Rng) -> RegisterOperation {
    match rng.u8(..10) {
        0..5 => read_joints(rng),
        5..9 => write_joints(rng),
        _ => read_all(rng),
    }
}

/// A stream of requests, and its expected result.
pub(crate) struct RequestStream {
    /// All requests, without gaps.
    pub(crate) requests: Vec<u8>,
    /// The replies to the undamaged requests.
    pub(crate) replies: Vec<u8>,
    pub(crate) undamaged: usize,
}

impl RequestStream {
    /// `count` requests of a case. Every protocol gets the same operations, and the same requests are damaged.
    pub(crate) fn new(case: &Case, protocol: Protocol, count: usize) -> Self {
        let mut stream = Self { requests: Vec::new(), replies: Vec::new(), undamaged: 0 };
        let mut registers = initial_values();
        let mut rng = Rng::with_seed(0x7B07);
        for _ in 0..count {
            let operation = (case.operation)(&mut rng);
            let is_damaged = rng.u32(..1000) < case.damaged_per_mille;
            let (byte, bits) = (rng.usize(..), rng.u8(1..));
            let mut request = protocol.request(&operation, &registers);
            if is_damaged {
                flip(&mut request, byte, bits);
            } else {
                operation.apply(&mut registers);
                stream.replies.extend(protocol.reply(&operation, &registers));
                stream.undamaged += 1;
            }
            stream.requests.extend(request);
        }
        stream
    }
}

/// Flips bits of one byte. An index beyond the frame wraps.
fn flip(frame: &mut [u8], byte: usize, bits: u8) {
    let index = byte % frame.len().max(1);
    if let Some(byte) = frame.get_mut(index) {
        *byte ^= bits;
    }
}
