//! The stack guard: register values for a region of the memory protection unit that denies all access, at the end of the
//! stack. The address range below the RAM is reserved, and the chip does not guarantee a fault there (RM0090, section 2.3).

/// Bytes of the guard: more than the stack frame of any function that runs after the start, so that none can skip the guard. The
/// larger frames of the start are at the top of the stack.
pub const SIZE: u32 = 1024;

/// MPU_CTRL (ARMv7-M reference manual, B3.5.5): enabled, with the default memory map outside the region (PRIVDEFENA).
/// Disabled in the handlers of hard faults and non-maskable interrupts (HFNMIENA = 0).
pub const CONTROL: u32 = 1 << 2 | 1 << 0;

/// MPU_RBAR (B3.5.8): region 0 at `start`, a multiple of [`SIZE`].
#[must_use]
pub const fn base(start: u32) -> u32 {
    const VALID: u32 = 1 << 4;
    start & !(SIZE - 1) | VALID
}

/// MPU_RASR (B3.5.9): enabled, no access (AP = 0), no execution (XN). A value n of its size field means 2^(n + 1) bytes.
#[must_use]
pub const fn attributes() -> u32 {
    const NO_INSTRUCTIONS: u32 = 1 << 28;
    const ON: u32 = 1 << 0;
    NO_INSTRUCTIONS | (SIZE.trailing_zeros() - 1) << 1 | ON
}

const _: () = assert!(SIZE.is_power_of_two() && SIZE >= 32);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_region_is_the_one_that_memory_x_reserves() {
        let layout = include_str!("../../memory.x");
        assert!(layout.contains("GUARD : ORIGIN = 0x20000000, LENGTH = 1K"), "{layout}");
        assert_eq!(SIZE, 1024);
        assert_eq!(base(0x2000_0000), 0x2000_0010, "region 0 at the start of the RAM");
    }

    #[test]
    fn the_register_values_follow_the_manual() {
        assert_eq!(attributes(), 0x1000_0013, "XN, AP 0, 2^10 bytes, on");
        assert_eq!(CONTROL, 0b101);
    }
}
