//! One frame: its layout, its parser, its encoder.
//!
//! Knows nothing of streams (the deframer's work) or of what a frame asks for.

use nom::bytes::streaming::{tag, take};
use nom::combinator::map_opt;
use nom::error::{ErrorKind, ParseError};
use nom::number::streaming::{le_u16, u8 as byte};
use nom::sequence::preceded;
use nom::{IResult, Needed, Parser};

use super::crc::checksum;

/// The two bytes every frame begins with.
pub const HEADER: [u8; 2] = [0xAA, 0x77];
/// Bytes before the data: header, function, address, count.
pub const PREFIX_LENGTH: usize = 5;
/// Bytes of the checksum.
pub const CRC_LENGTH: usize = 2;
/// The longest frame: 255 bytes of data in their envelope (D1).
pub const MAX_LENGTH: usize = PREFIX_LENGTH + 255 + CRC_LENGTH;

/// A frame as it goes on the line.
pub type FrameBuffer = heapless::Vec<u8, MAX_LENGTH>;

/// What a frame is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Function {
    /// 03: read registers, and the answer to it.
    Read = 0x03,
    /// 06: write registers; there is no answer (D6).
    Write = 0x06,
}

impl Function {
    const fn from_code(code: u8) -> Option<Self> {
        match code {
            0x03 => Some(Self::Read),
            0x06 => Some(Self::Write),
            _ => None,
        }
    }
}

/// Which way frames travel: it decides whether a read carries data.
pub trait Direction {
    /// Number of data bytes in a frame of this function and count.
    fn data_length(function: Function, count: u8) -> usize;
}

/// From the host to the arm: a read only asks.
#[derive(Clone, Copy, Debug)]
pub enum ToArm {}

/// From the arm to the host: a read brings the values.
#[derive(Clone, Copy, Debug)]
pub enum ToHost {}

impl Direction for ToArm {
    fn data_length(function: Function, count: u8) -> usize {
        match function {
            Function::Read => 0,
            Function::Write => usize::from(count),
        }
    }
}

impl Direction for ToHost {
    fn data_length(_: Function, count: u8) -> usize {
        usize::from(count)
    }
}

/// A whole frame with a right checksum and a range inside the address space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame<'a> {
    /// What it is about.
    pub function: Function,
    /// The first register.
    pub address: u8,
    /// How many registers.
    pub count: u8,
    /// Their values; empty in a read request.
    pub data: &'a [u8],
}

/// What is wrong with a stretch of bytes that begins like a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Defect {
    /// No header here, or a function this protocol does not know: not the beginning of a frame.
    NoFrame,
    /// The checksum is not that of the bytes before it.
    WrongCrc,
    /// The checksum is right, but the registers reach past address 255 (D2).
    MalformedRange {
        /// The first register asked for.
        address: u8,
    },
}

impl<I> ParseError<I> for Defect {
    fn from_error_kind(_: I, _: ErrorKind) -> Self {
        Self::NoFrame
    }

    fn append(_: I, _: ErrorKind, other: Self) -> Self {
        other
    }
}

/// What stands between the header and the data.
type Prefix = (Function, u8, u8);

/// Function, address and count of the frame at the beginning of `input`.
fn prefix(input: &[u8]) -> IResult<&[u8], Prefix, Defect> {
    preceded(tag(HEADER.as_slice()), (map_opt(byte, Function::from_code), byte, byte)).parse(input)
}

/// The rest of a frame, of which `rest` is what stands behind the prefix in `input`.
fn body<'a, D: Direction>(
    input: &'a [u8],
    rest: &'a [u8],
    (function, address, count): Prefix,
) -> IResult<&'a [u8], Frame<'a>, Defect> {
    let (rest, data) = take(D::data_length(function, count))(rest)?;
    let covered = input.get(..PREFIX_LENGTH + data.len()).unwrap_or(input);
    let (rest, crc) = le_u16(rest)?;
    if crc != checksum(covered) {
        return Err(nom::Err::Failure(Defect::WrongCrc));
    }
    if usize::from(address) + usize::from(count) > 256 {
        return Err(nom::Err::Failure(Defect::MalformedRange { address }));
    }
    Ok((rest, Frame { function, address, count, data }))
}

/// The frame at the beginning of `input`, which goes in direction `D`.
///
/// # Errors
/// `Incomplete` while bytes are missing; otherwise the [`Defect`].
pub fn parse<D: Direction>(input: &[u8]) -> IResult<&[u8], Frame<'_>, Defect> {
    let (rest, prefix) = prefix(input)?;
    body::<D>(input, rest, prefix)
}

impl<'a> Frame<'a> {
    /// Takes apart bytes that were judged to be a whole frame, without checking them again.
    pub(super) const fn of_judged(bytes: &'a [u8]) -> Option<Self> {
        let [_, _, code, address, count, data @ .., _, _] = bytes else { return None };
        match Function::from_code(*code) {
            Some(function) => Some(Self { function, address: *address, count: *count, data }),
            None => None,
        }
    }
}

/// What the beginning of a stretch of bytes is, and how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// A frame of this many bytes.
    Whole(usize),
    /// Not a frame, though as long as this many bytes; 1 where not even the header is right.
    Defective(Defect, usize),
    /// The beginning of a frame; it takes at least this many bytes to say more.
    Unfinished(usize),
}

/// Judges the beginning of `input`.
pub(super) fn judge<D: Direction>(input: &[u8]) -> Verdict {
    let (claimed, parsed) = match prefix(input) {
        Err(error) => (1, Err(error)),
        Ok((rest, prefix)) => {
            let claimed = PREFIX_LENGTH + D::data_length(prefix.0, prefix.2) + CRC_LENGTH;
            (claimed, body::<D>(input, rest, prefix))
        }
    };
    match parsed {
        Ok(_) => Verdict::Whole(claimed),
        Err(nom::Err::Incomplete(Needed::Size(more))) => Verdict::Unfinished(input.len() + more.get()),
        Err(nom::Err::Incomplete(Needed::Unknown)) => Verdict::Unfinished(input.len() + 1),
        Err(nom::Err::Error(defect) | nom::Err::Failure(defect)) => Verdict::Defective(defect, claimed),
    }
}

/// Writes a frame into `buffer`, over whatever was there.
///
/// `data` is at most 255 bytes long; what is beyond that is cut off, and no caller in this project has it.
pub fn encode(buffer: &mut FrameBuffer, function: Function, address: u8, count: u8, data: &[u8]) {
    buffer.clear();
    let prefix = [HEADER[0], HEADER[1], function as u8, address, count];
    // The buffer holds the longest frame, so nothing here can fail.
    let _ = buffer.extend_from_slice(&prefix);
    let _ = buffer.extend_from_slice(data.get(..255).unwrap_or(data));
    let crc = checksum(buffer).to_le_bytes();
    let _ = buffer.extend_from_slice(&crc);
}
