//! One frame: its layout, its parser, its encoder.
//!
//! This file knows neither streams, which the deframer handles, nor the meaning of a request.

use nom::bytes::streaming::take;
use nom::{IResult, Needed};

use super::crc::Crc;

/// The two bytes every frame begins with.
pub const HEADER: [u8; 2] = [0xAA, 0x77];
/// Bytes before the data: header, function, address, count.
pub const PREFIX_LENGTH: usize = 5;
/// Bytes of the CRC at the end of a frame, low byte first.
pub const CRC_LENGTH: usize = 2;
/// The shortest frame: one without data.
pub const MIN_LENGTH: usize = PREFIX_LENGTH + CRC_LENGTH;
/// The longest frame: 255 bytes of data with prefix and CRC ([D1](crate::decisions#d1)).
pub const MAX_LENGTH: usize = PREFIX_LENGTH + 255 + CRC_LENGTH;

/// An encoded frame of either direction; the longest one fits.
pub type FrameBuffer = heapless::Vec<u8, MAX_LENGTH>;

/// The function code of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Function {
    /// 03: a read request, the reply to one, or a report in map 2.2 ([D14](crate::decisions#d14)).
    Read = 0x03,
    /// 04: a write request in map 2.1; it has no reply ([M1](crate::decisions#m1)).
    WriteMap21 = 0x04,
    /// 05: a report in map 2.1 ([M4](crate::decisions#m4)).
    Report = 0x05,
    /// 06: a write request in map 2.2; it has no reply ([D6](crate::decisions#d6)).
    Write = 0x06,
    /// 08: an alarm ([M8](crate::decisions#m8)). It has a level and a kind in place of address and count, and no data.
    Alarm = 0x08,
}

/// The direction of a frame. It decides which functions there are, and whether a read carries data.
pub trait Direction {
    /// The function with this code; `None` if it is unknown in this direction.
    fn function(code: u8) -> Option<Function>;
    /// Number of data bytes in a frame of this function and count.
    fn data_length(function: Function, count: u8) -> usize;
    /// Does a frame of this function name a range of registers?
    fn has_range(function: Function) -> bool;
}

/// From the host to the arm: a read is a request without data.
#[derive(Clone, Copy, Debug)]
pub enum ToArm {}

/// From the arm to the host: a read is a reply or a report, which carries the values.
#[derive(Clone, Copy, Debug)]
pub enum ToHost {}

impl Direction for ToArm {
    fn function(code: u8) -> Option<Function> {
        match code {
            0x03 => Some(Function::Read),
            0x04 => Some(Function::WriteMap21),
            0x06 => Some(Function::Write),
            _ => None,
        }
    }

    fn data_length(function: Function, count: u8) -> usize {
        if function == Function::Read { 0 } else { usize::from(count) }
    }

    fn has_range(_: Function) -> bool {
        true
    }
}

impl Direction for ToHost {
    fn function(code: u8) -> Option<Function> {
        match code {
            0x05 => Some(Function::Report),
            0x08 => Some(Function::Alarm),
            _ => ToArm::function(code),
        }
    }

    fn data_length(function: Function, count: u8) -> usize {
        if function == Function::Alarm { 0 } else { usize::from(count) }
    }

    fn has_range(function: Function) -> bool {
        function != Function::Alarm
    }
}

/// A complete frame with a correct CRC and a range inside the address space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame<'a> {
    /// The function code. It tells what the fields below mean.
    pub function: Function,
    /// The first register; the level of an alarm.
    pub address: u8,
    /// How many registers; the kind of an alarm.
    pub count: u8,
    /// Values of the registers; empty in a read request and in an alarm.
    pub data: &'a [u8],
}

/// Why a complete frame is rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Defect {
    /// The CRC does not match the bytes before it.
    WrongCrc,
    /// The CRC is correct, but the range ends beyond address 255 ([D2](crate::decisions#d2)).
    MalformedRange {
        /// The first register of the range.
        address: u8,
    },
}

/// What [`parse`] finds at the beginning of its input. Lengths count bytes from there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParseOutcome<'a> {
    /// A frame with a correct CRC and a valid range, and its length.
    Complete(Frame<'a>, usize),
    /// A rejected frame and its length.
    Defective(Defect, usize),
    /// The beginning of a frame, and the least length that the frame can have.
    Incomplete(usize),
    /// No header, or an unknown function code.
    NotAFrame,
}

/// Function, address and count.
type Prefix = (Function, u8, u8);

/// Parses the prefix of a frame.
#[inline(always)]
fn prefix<D: Direction>(input: &[u8]) -> IResult<&[u8], Prefix, ()> {
    match input {
        [first, second, code, address, count, rest @ ..] if [*first, *second] == HEADER => {
            let function = D::function(*code).ok_or(nom::Err::Error(()))?;
            Ok((rest, (function, *address, *count)))
        }
        [_, _, _, _, _, ..] => Err(nom::Err::Error(())),
        short if may_begin::<D>(short) => Err(nom::Err::Incomplete(Needed::new(PREFIX_LENGTH - short.len()))),
        _ => Err(nom::Err::Error(())),
    }
}

/// The CRC over header and prefix.
#[inline(always)]
fn crc_of_prefix((function, address, count): Prefix) -> Crc {
    Crc::START.word([HEADER[0], HEADER[1], function as u8, address]).byte(count)
}

/// Returns whether these bytes, too few for a prefix, can begin a frame.
fn may_begin<D: Direction>(bytes: &[u8]) -> bool {
    let is_header = bytes.iter().zip(&HEADER).all(|(found, expected)| found == expected);
    is_header && bytes.get(2).is_none_or(|&code| D::function(code).is_some())
}

/// Parses data and CRC, and checks the frame.
#[inline(always)]
fn body<'a, D: Direction>(
    input: &'a [u8],
    (function, address, count): Prefix,
) -> IResult<&'a [u8], Result<Frame<'a>, Defect>, ()> {
    let (rest, data) = take(D::data_length(function, count))(input)?;
    let (rest, crc) = take(CRC_LENGTH)(rest)?;
    let sum = crc_of_prefix((function, address, count));
    let sum = if data.is_empty() { sum } else { sum.bytes(data) };
    let checked = if crc != sum.finish().to_le_bytes() {
        Err(Defect::WrongCrc)
    } else if D::has_range(function) && usize::from(address) + usize::from(count) > 256 {
        Err(Defect::MalformedRange { address })
    } else {
        Ok(Frame { function, address, count, data })
    };
    Ok((rest, checked))
}

/// Parses the frame at the beginning of `input`, which goes in direction `D`.
///
/// On the host, inlining saves a third of the parse time. On the chip it spills CPU registers and costs flash.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
#[must_use]
pub fn parse<D: Direction>(input: &[u8]) -> ParseOutcome<'_> {
    let (length, parsed) = match prefix::<D>(input) {
        Err(error) => (MIN_LENGTH, Err(error)),
        Ok((rest, prefix)) => {
            let length = PREFIX_LENGTH + D::data_length(prefix.0, prefix.2) + CRC_LENGTH;
            (length, body::<D>(rest, prefix))
        }
    };
    match parsed {
        Ok((_, Ok(frame))) => ParseOutcome::Complete(frame, length),
        Ok((_, Err(defect))) => ParseOutcome::Defective(defect, length),
        Err(nom::Err::Incomplete(_)) => ParseOutcome::Incomplete(length),
        Err(nom::Err::Error(()) | nom::Err::Failure(())) => ParseOutcome::NotAFrame,
    }
}

/// Encodes a frame into `buffer`, replacing its content. `data` is cut to 255 bytes.
pub fn encode(buffer: &mut FrameBuffer, function: Function, address: u8, count: u8, data: &[u8]) {
    buffer.clear();
    let (words, rest) = data.get(..255).unwrap_or(data).as_chunks();
    // The buffer holds the longest frame, so nothing here can fail.
    let _ = buffer.extend_from_slice(&[HEADER[0], HEADER[1], function as u8, address]);
    let _ = buffer.push(count);
    // Copy and compute the CRC in one pass: a separate call to copy takes longer. This is a loop, because in a fold that starts
    // with the CRC of the prefix, the compiler computes the address of each word twice.
    let mut crc = crc_of_prefix((function, address, count));
    for word in words {
        let _ = buffer.extend_from_slice(word);
        crc = crc.word(*word);
    }
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
