//! Register values as numbers in the units of the register table, and back.

use protocol_core::registers::map21::find_readable;

use crate::names::name_of_register;
use crate::register_text::range;
use host_link::Span;

/// Why numbers are no values of registers. Nothing was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ValueError {
    /// There is neither one number for all registers nor one for each.
    #[error("{given} values for {registers} registers: one each, or one for all")]
    Count {
        /// The number of values, which is neither 1 nor `registers`.
        given: usize,
        /// The number of registers. For [`bytes()`] one of two bytes counts once.
        registers: usize,
    },
    /// The span holds half of a two-byte register ([D22](protocol_core::decisions#d22)).
    #[error("{} has two bytes, and {half} is one of them: use the name", name_of_register(*first))]
    HalfAWord {
        /// The register's low byte.
        first: u8,
        /// The byte in the span.
        half: u8,
    },
    /// The number is out of the register's range.
    #[error("{value} is out of range: {} takes {}", name_of_register(*address), range(*address))]
    OutOfRange {
        /// The address of the register; of a two-byte register, its low byte.
        address: u8,
        /// The number that was given, in the table's unit.
        value: i32,
    },
    /// The number is not a byte. Only for raw bytes, and where the table has no register.
    #[error("{0} is not a byte, 0 to 255")]
    NotAByte(i32),
}

/// The bytes of a span: one number per register, or one for all. A register of two bytes takes one number.
///
/// ```
/// use sevenbot::register_values::bytes;
///
/// assert_eq!(bytes(sevenbot::names::parse("offset.2")?, &[-5]), Ok(vec![0x85]));
/// assert_eq!(bytes(sevenbot::names::parse("set-point-period")?, &[300]), Ok(vec![0x2C, 1]));
/// # Ok::<(), sevenbot::names::NameError>(())
/// ```
///
/// # Errors
/// The span holds half of a two-byte register, or the numbers are too few, too many or out of range. The range is checked
/// here, because the maker's firmware does not check it.
pub fn bytes(span: Span, values: &[i32]) -> Result<Vec<u8>, ValueError> {
    let registers = registers(span)?;
    let mut bytes = Vec::new();
    for (register, value) in registers.iter().zip(one_each(registers.len(), values)?) {
        let encoded = encoded(register.address(), value)?.to_le_bytes();
        bytes.extend(encoded.into_iter().take(usize::from(register.count())));
    }
    Ok(bytes)
}

/// As [`bytes()`], but takes one byte for each address, and does not check the registers' ranges.
///
/// # Errors
/// The numbers are too few, too many or no bytes.
pub fn raw_bytes(span: Span, values: &[i32]) -> Result<Vec<u8>, ValueError> {
    one_each(usize::from(span.count()), values)?.into_iter().map(raw_byte).collect()
}

fn one_each(registers: usize, values: &[i32]) -> Result<Vec<i32>, ValueError> {
    match values {
        [only] => Ok(vec![*only; registers]),
        all if all.len() == registers => Ok(all.to_vec()),
        all => Err(ValueError::Count { given: all.len(), registers }),
    }
}

/// The registers of a span: one byte each, or two where the table has two-byte registers.
fn registers(span: Span) -> Result<Vec<Span>, ValueError> {
    let mut registers = Vec::new();
    let mut addresses = span.addresses().peekable();
    while let Some(address) = addresses.next() {
        let row = find_readable(address).filter(|row| row.range.width() == 2);
        let Some(row) = row else {
            registers.push(Span::one(address));
            continue;
        };
        let is_low = address.wrapping_sub(row.address).is_multiple_of(2);
        let high = addresses.next_if(|next| is_low && *next == address.wrapping_add(1));
        let (Some(_), Some(word)) = (high, Span::new(address, 2)) else {
            let first = if is_low { address } else { address.wrapping_sub(1) };
            return Err(ValueError::HalfAWord { first, half: address });
        };
        registers.push(word);
    }
    Ok(registers)
}

fn raw_byte(value: i32) -> Result<u8, ValueError> {
    u8::try_from(value).map_err(|_| ValueError::NotAByte(value))
}

fn encoded(address: u8, value: i32) -> Result<u16, ValueError> {
    let Some(row) = find_readable(address) else { return raw_byte(value).map(u16::from) };
    row.range.encode(value).ok_or(ValueError::OutOfRange { address, value })
}
