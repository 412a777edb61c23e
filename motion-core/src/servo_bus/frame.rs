//! The frames of the servo bus and the names of the servos' registers, for both ends of the wire.
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
//! Fields of 16 bits go high byte first: that is the SCS series; STS and SMS do it the other way round.
//! Knows nothing of time-outs, nor of whose turn it is to speak. Tests: `tests/servo_frames.rs`.

/// The longest frame of either direction; a sync write of six bytes to seven servos takes 57.
pub const MAX_FRAME: usize = 64;
/// Bytes of a frame without parameters.
const ENVELOPE: usize = 6;
/// Bytes that the length byte does not count: header, id and the length byte itself.
const UNCOUNTED: usize = 4;
/// The id that all servos take for theirs. None answers to it.
pub const BROADCAST: u8 = 0xFE;

/// A frame as it goes on the wire.
pub type FrameBuffer = heapless::Vec<u8, MAX_FRAME>;

/// What a servo is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Instruction {
    /// Answer, if you are there.
    Ping = 0x01,
    /// Answer with the values of some registers.
    Read = 0x02,
    /// Take these values, and acknowledge.
    Write = 0x03,
    /// Several servos take values for the same registers at one instant; none answers.
    SyncWrite = 0x83,
}

impl Instruction {
    /// The instruction with this code; `None` for those that nobody here uses.
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

/// The registers of a servo. The pairs of bytes are 16-bit values, high byte first.
pub mod register {
    /// Motor off, on or free: the meanings of the codes differ from table to table.
    pub const TORQUE_SWITCH: u8 = 40;
    /// Where to go, in counts 0 to 1023; two bytes.
    pub const GOAL_POSITION: u8 = 42;
    /// How long to take, in milliseconds, if the goal speed is 0; two bytes.
    pub const GOAL_TIME: u8 = 44;
    /// How fast to go, in counts per second; 0 is as fast as the motor can; two bytes.
    pub const GOAL_SPEED: u8 = 46;
    /// Lock of the servo's own EEPROM.
    pub const LOCK: u8 = 48;
    /// Where the servo is, in counts; two bytes, and the first of the eight of a `Reading`.
    pub const PRESENT_POSITION: u8 = 56;
    /// How fast it goes; two bytes, bit 15 is the sign.
    pub const PRESENT_SPEED: u8 = 58;
    /// How hard it pushes, in 0.1 %; two bytes, bit 10 is the sign.
    pub const PRESENT_LOAD: u8 = 60;
    /// Its supply, in 0.1 V.
    pub const PRESENT_VOLTAGE: u8 = 62;
    /// Its temperature, in degrees Celsius.
    pub const PRESENT_TEMPERATURE: u8 = 63;
    /// The bits of [`error`](super::error).
    pub const STATUS: u8 = 65;
    /// 1 while it moves.
    pub const MOVING: u8 = 66;
}

/// What a servo complains about: the bits of the error byte of its answers.
pub mod error {
    /// The supply is too low or too high.
    pub const VOLTAGE: u8 = 1 << 0;
    /// The motor is too hot.
    pub const OVERHEAT: u8 = 1 << 2;
    /// The motor pushed too hard for too long. Stays until torque is switched off and on.
    pub const OVERLOAD: u8 = 1 << 5;
}

/// Asks a servo whether it is there.
pub fn ping(buffer: &mut FrameBuffer, id: u8) {
    begin(buffer, id, Instruction::Ping as u8);
    finish(buffer);
}

/// Asks a servo for `count` registers from `register` on.
pub fn read(buffer: &mut FrameBuffer, id: u8, register: u8, count: u8) {
    begin(buffer, id, Instruction::Read as u8);
    append(buffer, &[register, count]);
    finish(buffer);
}

/// Gives a servo, or all with [`BROADCAST`], values for the registers from `register` on. More than 57
/// of them do not fit a frame and are left out as a whole.
pub fn write(buffer: &mut FrameBuffer, id: u8, register: u8, data: &[u8]) {
    begin(buffer, id, Instruction::Write as u8);
    append(buffer, &[register]);
    append(buffer, data);
    finish(buffer);
}

/// Gives each servo of `items` (its id and its values) `W` values for the registers from `register` on.
/// Items that do not fit the frame any more are left out.
pub fn sync_write<const W: usize>(
    buffer: &mut FrameBuffer,
    register: u8,
    items: impl Iterator<Item = (u8, [u8; W])>,
) {
    const { assert!(W < MAX_FRAME, "not even one item would fit a frame") };
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

/// What a servo answers: its error bits and, to a read, the values. More than 58 of them do not fit and
/// are left out as a whole.
pub fn status(buffer: &mut FrameBuffer, id: u8, error: u8, data: &[u8]) {
    begin(buffer, id, error);
    append(buffer, data);
    finish(buffer);
}

fn begin(buffer: &mut FrameBuffer, id: u8, code: u8) {
    buffer.clear();
    // Cannot fail: the buffer is empty.
    let _ = buffer.extend_from_slice(&[0xFF, 0xFF, id, 0, code]);
}

/// Adds all of `bytes`, or nothing where that would leave no room for the checksum.
fn append(buffer: &mut FrameBuffer, bytes: &[u8]) {
    if buffer.len() + bytes.len() < MAX_FRAME {
        let _ = buffer.extend_from_slice(bytes);
    }
}

fn finish(buffer: &mut FrameBuffer) {
    let [length, ..] = (buffer.len() + 1 - UNCOUNTED).to_le_bytes();
    if let Some(place) = buffer.get_mut(3) {
        *place = length;
    }
    // Cannot fail: `append` leaves room.
    let _ = buffer.push(checksum(buffer.get(2..).unwrap_or(&[])));
}

/// The complement of the sum of `bytes`.
fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte))
}

/// A whole frame with a right checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame<'a> {
    /// The servo it goes to or comes from.
    pub id: u8,
    /// The instruction's code on the way to a servo, the [`error`] bits on the way back.
    pub code: u8,
    /// What stands between the code and the checksum.
    pub params: &'a [u8],
}

/// Something began like a frame and was as long as one, but its checksum was wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WrongChecksum;

/// Finds the frames in a stream of bytes, of either direction.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    buffer: heapless::Vec<u8, { Decoder::CAPACITY }>,
    /// Everything before it is done with.
    head: usize,
}

/// What the beginning of a stretch of bytes is.
enum Verdict<'a> {
    Whole(Frame<'a>),
    WrongChecksum,
    Unfinished,
    NoFrame,
}

impl Decoder {
    /// How many bytes it remembers: the echo of the longest frame and an answer behind it.
    pub const CAPACITY: usize = 2 * MAX_FRAME;

    /// A decoder that has seen nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { buffer: heapless::Vec::new(), head: 0 }
    }

    /// Takes bytes that came. Once it holds more than [`Decoder::CAPACITY`], the oldest are lost; pull in
    /// between.
    pub fn push(&mut self, bytes: &[u8]) {
        let newest = bytes.get(bytes.len().saturating_sub(Self::CAPACITY)..).unwrap_or(bytes);
        let excess = (self.buffer.len() + newest.len()).saturating_sub(Self::CAPACITY);
        if excess != 0 {
            self.forget(excess.max(self.head));
        }
        // Cannot fail: there is room now.
        let _ = self.buffer.extend_from_slice(newest);
    }

    /// The next frame, or the next thing that was one but for its checksum; `None` when more bytes are
    /// needed to say anything. Call it until then. Behind a wrong checksum the search goes on with the
    /// very next byte, so damage to one frame does not cost the next.
    pub fn pull(&mut self) -> Option<Result<Frame<'_>, WrongChecksum>> {
        loop {
            match judge(self.buffer.get(self.head..)?) {
                Verdict::Unfinished => return None,
                Verdict::NoFrame => self.head += 1,
                Verdict::WrongChecksum => {
                    self.head += 1;
                    return Some(Err(WrongChecksum));
                }
                Verdict::Whole(frame) => {
                    self.head += ENVELOPE + frame.params.len();
                    return Some(Ok(frame));
                }
            }
        }
    }

    /// Forgets all bytes: what comes from now on has nothing to do with what came before.
    pub fn clear(&mut self) {
        *self = Self::new();
    }

    fn forget(&mut self, count: usize) {
        let mut kept = heapless::Vec::new();
        // Cannot fail: it is a part of a buffer of the same size.
        let _ = kept.extend_from_slice(self.buffer.get(count..).unwrap_or(&[]));
        self.buffer = kept;
        self.head = self.head.saturating_sub(count);
    }
}

/// Judges the beginning of `bytes`. No servo has the id FF, so three of them are a header one byte on.
fn judge(bytes: &[u8]) -> Verdict<'_> {
    match bytes {
        [] | [0xFF] | [0xFF, 0xFF] => Verdict::Unfinished,
        [0xFF, 0xFF, 0xFF, ..] => Verdict::NoFrame,
        [0xFF, 0xFF, rest @ ..] => judge_body(rest),
        _ => Verdict::NoFrame,
    }
}

/// Judges what stands behind the header.
fn judge_body(body: &[u8]) -> Verdict<'_> {
    let Some(&length) = body.get(1) else { return Verdict::Unfinished };
    let length = usize::from(length);
    if !(2..=MAX_FRAME - UNCOUNTED).contains(&length) {
        return Verdict::NoFrame;
    }
    match body.get(..2 + length) {
        Some([covered @ .., sum]) if checksum(covered) != *sum => Verdict::WrongChecksum,
        Some([id, _, code, params @ .., _]) => Verdict::Whole(Frame { id: *id, code: *code, params }),
        _ => Verdict::Unfinished,
    }
}

/// What a servo measures: its answer to a read of [`Reading::REGISTERS`] bytes from
/// [`register::PRESENT_POSITION`] on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// Where it is, 0 to 1023.
    pub position_counts: u16,
    /// How fast it goes, in counts per second.
    pub speed: i16,
    /// How hard it pushes, in 0.1 % of what it can.
    pub load: i16,
    /// Its supply, in 0.1 V.
    pub voltage_decivolts: u8,
    /// Its temperature, in degrees Celsius.
    pub temperature_celsius: u8,
}

impl Reading {
    /// How many registers it takes.
    pub const REGISTERS: u8 = 8;
    /// The highest position there is.
    pub const MAX_POSITION: u16 = 1023;
    const SPEED_SIGN: u16 = 1 << 15;
    const LOAD_SIGN: u16 = 1 << 10;

    /// The values in the parameters of an answer; `None` where their number is wrong or the position is
    /// none, so that no failed read ever becomes a measurement.
    #[must_use]
    pub fn parse(params: &[u8]) -> Option<Self> {
        let &[p1, p0, s1, s0, l1, l0, voltage_decivolts, temperature_celsius] = params else { return None };
        let position_counts = u16::from_be_bytes([p1, p0]);
        (position_counts <= Self::MAX_POSITION).then_some(Self {
            position_counts,
            speed: signed(u16::from_be_bytes([s1, s0]), Self::SPEED_SIGN),
            load: signed(u16::from_be_bytes([l1, l0]), Self::LOAD_SIGN),
            voltage_decivolts,
            temperature_celsius,
        })
    }

    /// The values as a servo answers them; magnitudes past the field's are cut to its highest.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::REGISTERS as usize] {
        let [p1, p0] = self.position_counts.to_be_bytes();
        let [s1, s0] = sign_and_magnitude(self.speed, Self::SPEED_SIGN).to_be_bytes();
        let [l1, l0] = sign_and_magnitude(self.load, Self::LOAD_SIGN).to_be_bytes();
        [p1, p0, s1, s0, l1, l0, self.voltage_decivolts, self.temperature_celsius]
    }
}

/// The number in the bits below `sign`, a power of two, negative if that bit is set.
fn signed(field: u16, sign: u16) -> i16 {
    let magnitude = (field & (sign - 1)).cast_signed();
    if field & sign == 0 { magnitude } else { -magnitude }
}

/// The other way round.
fn sign_and_magnitude(number: i16, sign: u16) -> u16 {
    let magnitude = number.unsigned_abs().min(sign - 1);
    if number < 0 { magnitude | sign } else { magnitude }
}
