//! The chip id: reduces the 96-bit unique id of an STM32 to the six bytes of the register map
//! ([D8](crate::decisions#d8)).

/// Low bits of x^48 + x^47 + x^21 + x^20 + 1, a primitive polynomial.
const POLYNOMIAL: u64 = (1 << 47) | (1 << 21) | (1 << 20) | 1;
const MASK: u64 = (1 << 48) - 1;

/// Reduces a unique id (12 bytes in the order of their addresses, reference manual RM0090 section 39.1)
/// to the chip id, most significant byte first.
///
/// The chip id is the remainder modulo a polynomial of degree 48. Two unique ids that differ only within 48 consecutive
/// bits have different chip ids. So have chips of one lot, whose unique ids differ only in the first 40 bits (position on the
/// wafer, wafer number). Any two other chips collide with a probability of 2^-48.
#[must_use]
pub fn reduce(unique_id: [u8; 12]) -> [u8; 6] {
    let mut remainder: u64 = 0;
    for byte in unique_id {
        remainder ^= u64::from(byte) << 40;
        for _ in 0..8 {
            let carry = remainder >> 47 & 1;
            remainder = ((remainder << 1) ^ (carry * POLYNOMIAL)) & MASK;
        }
    }
    let [_, _, id @ ..] = remainder.to_be_bytes();
    id
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chip_id_never_changes() {
        assert_eq!(reduce([0; 12]), [0; 6]);
        assert_eq!(reduce(*b"\x33\x00\x25\x00\x0c\x51\x34\x36\x33\x32\x36\x36"), GOLDEN);
    }

    /// Calculated with a separate program (long division over GF(2)). A change would give released arms another chip id.
    const GOLDEN: [u8; 6] = [0xAB, 0x46, 0xDB, 0xA5, 0x94, 0x95];

    #[test]
    fn chips_of_one_lot_never_share_a_chip_id() {
        // The remainder is linear, so ids that differ in the first 40 bits collide only if a difference
        // has remainder zero: 40 independent remainders rule that out.
        let mut basis: Vec<u64> = Vec::new();
        for bit in 0..40 {
            let mut id = [0; 12];
            id[bit / 8] = 1 << (bit % 8);
            let [a, b, c, d, e, f] = reduce(id);
            let mut value = u64::from_be_bytes([0, 0, a, b, c, d, e, f]);
            for &other in &basis {
                value = value.min(value ^ other);
            }
            assert_ne!(value, 0, "bit {bit}");
            basis.push(value);
        }
    }
}
