//! One frame: its layout, its parser, its encoder.
//!
//! Knows nothing of streams (the deframer's work) or of what a frame asks for.

use nom::bytes::streaming::take;
use nom::error::{ErrorKind, ParseError};
use nom::{IResult, Needed};

use super::crc::Crc;

/// The two bytes every frame begins with.
pub const HEADER: [u8; 2] = [0xAA, 0x77];
/// Bytes before the data: header, function, address, count.
pub const PREFIX_LENGTH: usize = 5;
/// Bytes of the checksum.
pub const CRC_LENGTH: usize = 2;
/// The shortest frame: one without data.
pub(super) const MIN_LENGTH: usize = PREFIX_LENGTH + CRC_LENGTH;
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
#[inline(always)]
fn prefix(input: &[u8]) -> IResult<&[u8], Prefix, Defect> {
    match input {
        [first, second, code, address, count, rest @ ..] if [*first, *second] == HEADER => {
            let function = Function::from_code(*code).ok_or(nom::Err::Error(Defect::NoFrame))?;
            Ok((rest, (function, *address, *count)))
        }
        [_, _, _, _, _, ..] => Err(nom::Err::Error(Defect::NoFrame)),
        short if may_begin(short) => Err(nom::Err::Incomplete(Needed::new(PREFIX_LENGTH - short.len()))),
        _ => Err(nom::Err::Error(Defect::NoFrame)),
    }
}

/// The checksum of a frame's first bytes.
#[inline(always)]
fn crc_of_prefix((function, address, count): Prefix) -> Crc {
    Crc::START.word([HEADER[0], HEADER[1], function as u8, address]).byte(count)
}

/// Could these bytes, too few for a prefix, be the first of one?
fn may_begin(bytes: &[u8]) -> bool {
    let is_header = bytes.iter().zip(&HEADER).all(|(found, expected)| found == expected);
    is_header && bytes.get(2).is_none_or(|&code| Function::from_code(code).is_some())
}

/// The frame with this prefix, of which `rest` is what stands behind it.
#[inline(always)]
fn body<'a, D: Direction>(
    rest: &'a [u8],
    (function, address, count): Prefix,
) -> IResult<&'a [u8], Frame<'a>, Defect> {
    let (rest, data) = take(D::data_length(function, count))(rest)?;
    let (rest, crc) = take(CRC_LENGTH)(rest)?;
    let sum = crc_of_prefix((function, address, count));
    let sum = if data.is_empty() { sum } else { sum.bytes(data) };
    if crc != sum.finish().to_le_bytes() {
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
    body::<D>(rest, prefix)
}

/// What the beginning of a stretch of bytes is, and how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict<'a> {
    /// A frame of this many bytes.
    Whole(Frame<'a>, usize),
    /// Not a frame, though as long as this many bytes; 1 where not even the header is right.
    Defective(Defect, usize),
    /// The beginning of a frame, which takes at least this many bytes.
    Unfinished(usize),
}

/// Judges the beginning of `input`.
///
/// In line it takes a third less, but not on the chip, where registers run out and flash is dear.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
pub(super) fn judge<D: Direction>(input: &[u8]) -> Verdict<'_> {
    let (claimed, parsed) = match prefix(input) {
        Err(error) => (1, Err(error)),
        Ok((rest, prefix)) => {
            let claimed = PREFIX_LENGTH + D::data_length(prefix.0, prefix.2) + CRC_LENGTH;
            (claimed, body::<D>(rest, prefix))
        }
    };
    match parsed {
        Ok((_, frame)) => Verdict::Whole(frame, claimed),
        Err(nom::Err::Incomplete(_)) => Verdict::Unfinished(claimed.max(MIN_LENGTH)),
        Err(nom::Err::Error(defect) | nom::Err::Failure(defect)) => Verdict::Defective(defect, claimed),
    }
}

/// Writes a frame into `buffer`, over whatever was there.
///
/// `data` is at most 255 bytes long; what is beyond that is cut off, and no caller in this project has it.
pub fn encode(buffer: &mut FrameBuffer, function: Function, address: u8, count: u8, data: &[u8]) {
    buffer.clear();
    // The buffer holds the longest frame, so nothing here can fail.
    let _ = buffer.extend_from_slice(&[HEADER[0], HEADER[1], function as u8, address]);
    let _ = buffer.push(count);
    // Copied and summed up at once: a call that copies costs more than that.
    let (words, rest) = data.get(..255).unwrap_or(data).as_chunks();
    let crc = words.iter().fold(crc_of_prefix((function, address, count)), |crc, word| {
        let _ = buffer.extend_from_slice(word);
        crc.word(*word)
    });
    let (halves, rest) = rest.as_chunks();
    let crc = halves.iter().fold(crc, |crc, half| {
        let _ = buffer.extend_from_slice(half);
        crc.half(*half)
    });
    let crc = rest.iter().fold(crc, |crc, &byte| {
        let _ = buffer.push(byte);
        crc.byte(byte)
    });
    let _ = buffer.extend_from_slice(&crc.finish().to_le_bytes());
}
