//! The frames of the servo bus, for both ends of the wire.
//!
//! ```text
//!     0    1    2     3        4         5 ..           4+len-1
//!   ┌────┬────┬────┬─────┬───────────┬──────────────┬──────────┐
//!   │ FF │ FF │ id │ len │   code    │  parameters  │ checksum │    len = parameters + 2
//!   └────┴────┴────┴─────┴───────────┴──────────────┴──────────┘
//!     header              instruction                 complement of the sum of id,
//!                         (to a servo)                len, code and parameters
//!                         or error bits
//!                         (from a servo)
//! ```
//!
//! In the SCS series, 16-bit fields are sent high byte first; STS and SMS servos send the low byte first. This file
//! does not know timeouts or transactions. Its tests are in `tests/all/servo_frames.rs`.

mod decoder;
pub mod error;
mod reading;
pub mod register;

pub use decoder::{Decoder, WrongChecksum};
pub use reading::Reading;

/// The longest frame of either direction; a sync write of six bytes to seven servos takes 57.
pub const MAX_FRAME: usize = 64;
/// Bytes of a frame without parameters.
const ENVELOPE: usize = 6;
/// Bytes that the length byte does not count: header, id and the length byte itself.
const UNCOUNTED: usize = 4;
/// The broadcast id. No servo answers a broadcast.
pub const BROADCAST: u8 = 0xFE;

/// An encoded frame, from either end of the bus.
pub type ServoFrameBuffer = heapless::Vec<u8, MAX_FRAME>;

/// The instruction in a frame to a servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Instruction {
    /// Asks for an answer without values.
    Ping = 0x01,
    /// Asks for registers; the servo answers with their values.
    Read = 0x02,
    /// Writes registers; the servo acknowledges unless its response level is 0.
    Write = 0x03,
    /// Writes the same registers of several servos simultaneously; no servo answers.
    SyncWrite = 0x83,
}

impl Instruction {
    /// The instruction with this code; `None` if this project does not use it.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0x01 => Some(Self::Ping),
            0x02 => Some(Self::Read),
            0x03 => Some(Self::Write),
            0x83 => Some(Self::SyncWrite),
            _ => None,
        }
    }
}

/// The baud rates of an SCS servo, in the order of the codes of [`register::BAUD_RATE`].
pub const BAUD_RATES: [u32; 8] = [1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400];

/// Encodes a ping, which the servo answers without values.
pub fn ping(buffer: &mut ServoFrameBuffer, id: u8) {
    begin(buffer, id, Instruction::Ping as u8);
    finish(buffer);
}

/// Encodes a read of `count` registers from `register` on.
pub fn read(buffer: &mut ServoFrameBuffer, id: u8, register: u8, count: u8) {
    begin(buffer, id, Instruction::Read as u8);
    append(buffer, &[register, count]);
    finish(buffer);
}

/// Encodes a write to the registers from `register` on, of one servo or with [`BROADCAST`] of all. If there are more
/// than 57 values, the frame carries none.
pub fn write(buffer: &mut ServoFrameBuffer, id: u8, register: u8, data: &[u8]) {
    begin(buffer, id, Instruction::Write as u8);
    append(buffer, &[register]);
    append(buffer, data);
    finish(buffer);
}

/// Encodes a write of `W` registers from `register` on for each servo in `items`, which holds ids and values. Items that
/// do not fit the frame are left out.
pub fn sync_write<const W: usize>(
    buffer: &mut ServoFrameBuffer,
    register: u8,
    items: impl Iterator<Item = (u8, [u8; W])>,
) {
    const { assert!(W < MAX_FRAME, "an item must fit a frame") };
    begin(buffer, BROADCAST, Instruction::SyncWrite as u8);
    append(buffer, &[register, W.to_le_bytes()[0]]);
    for (id, values) in items {
        if buffer.len() + 1 + W < MAX_FRAME {
            append(buffer, &[id]);
            append(buffer, &values);
        }
    }
    finish(buffer);
}

/// Encodes a servo's answer: its error bits and, after a read, the values. If there are more than 58 values, the frame
/// carries none.
pub fn status(buffer: &mut ServoFrameBuffer, id: u8, error: u8, data: &[u8]) {
    begin(buffer, id, error);
    append(buffer, data);
    finish(buffer);
}

fn begin(buffer: &mut ServoFrameBuffer, id: u8, code: u8) {
    buffer.clear();
    // Cannot fail: the buffer is empty.
    let _ = buffer.extend_from_slice(&[0xFF, 0xFF, id, 0, code]);
}

/// Appends all of `bytes`, or none if that leaves no room for the checksum.
fn append(buffer: &mut ServoFrameBuffer, bytes: &[u8]) {
    if buffer.len() + bytes.len() < MAX_FRAME {
        let _ = buffer.extend_from_slice(bytes);
    }
}

fn finish(buffer: &mut ServoFrameBuffer) {
    let [length, ..] = (buffer.len() + 1 - UNCOUNTED).to_le_bytes();
    if let Some(field) = buffer.get_mut(3) {
        *field = length;
    }
    // Cannot fail: `append` leaves room.
    let _ = buffer.push(checksum(buffer.get(2..).unwrap_or(&[])));
}

/// The complement of the sum of `bytes`.
fn checksum(bytes: &[u8]) -> u8 {
    // Four bytes at a time: the low half sums bytes 0 and 1 of each word, the high half bytes 2 and 3. A frame is too short to
    // overflow 16 bits.
    let (words, rest) = bytes.as_chunks();
    let [low, _, high, _] = words
        .iter()
        .map(|&word| u32::from_le_bytes(word))
        .fold(0_u32, |sum, word| sum.wrapping_add(word & 0x00FF_00FF).wrapping_add(word >> 8 & 0x00FF_00FF))
        .to_le_bytes();
    !rest.iter().fold(low.wrapping_add(high), |sum, &byte| sum.wrapping_add(byte))
}

/// A complete frame with a correct checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ServoFrame<'a> {
    /// The servo that receives or sends the frame.
    pub id: u8,
    /// To a servo: the code of the instruction. From a servo: the [`error`] bits.
    pub code: u8,
    /// The bytes between code and checksum.
    pub params: &'a [u8],
}
