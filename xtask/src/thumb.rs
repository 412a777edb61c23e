//! What an instruction of Thumb code does to the flow of control, to the stack pointer and to interrupts; nothing
//! else about it matters here. Encodings: ARMv7-M Architecture Reference Manual (DDI 0403), chapter A7.7.

/// What an instruction does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// Calls the function at this address.
    Call(u64),
    /// Goes on at this address, always or perhaps.
    Jump(u64),
    /// Goes back to the caller.
    Return,
    /// Goes on at an address that is known only when it runs, and is no return.
    Indirect,
    /// Lowers the stack pointer by this many bytes.
    Push(u64),
    /// Sets the stack pointer to something that is known only when it runs.
    StackSet,
    /// Sleeps until an interrupt comes.
    Wait,
    /// Shuts interrupts out.
    ShutOut,
    /// Lets interrupts in, or may do so.
    LetIn,
    /// Nothing of this.
    None,
}

/// The stack pointer's number among the registers, and those of the return address and of the next instruction's.
const SP: u16 = 13;
const LR: u16 = 14;
const PC: u16 = 15;

/// Is this half of an instruction followed by another?
pub(crate) const fn is_wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// The effect of the instruction at `at`; `second` counts only where the first half is wide.
pub(crate) fn effect(at: u64, first: u16, second: u16) -> Effect {
    if is_wide(first) { wide(at, first, second) } else { narrow(at, first) }
}

fn narrow(at: u64, word: u16) -> Effect {
    let jump = |distance: i64| Effect::Jump((at + 4).wrapping_add_signed(distance));
    // Of the forms with high registers: the one that changes, and the one that is looked at.
    let (changed, read) = (word >> 4 & 8 | word & 7, word >> 3 & 0xF);
    match word {
        0xBD00..=0xBDFF => Effect::Return,
        0xB400..=0xB5FF => Effect::Push(4 * u64::from((word & 0x1FF).count_ones())),
        0xB080..=0xB0FF => Effect::Push(4 * u64::from(word & 0x7F)),
        // B<cond>; the last two conditions are UDF and SVC.
        0xD000..=0xDDFF => jump(signed(word & 0xFF, 8) * 2),
        0xE000..=0xE7FF => jump(signed(word & 0x7FF, 11) * 2),
        // CBZ, CBNZ.
        _ if word & 0xF500 == 0xB100 => jump(i64::from(word >> 3 & 0x40 | word >> 2 & 0x3E)),
        0xBF30 => Effect::Wait,
        0xB672 => Effect::ShutOut,
        0xB662 => Effect::LetIn,
        0x4700..=0x477F if read == LR => Effect::Return,
        0x4700..=0x47FF => Effect::Indirect,
        // ADD and MOV between any two registers.
        0x4400..=0x44FF | 0x4600..=0x46FF if changed == SP => Effect::StackSet,
        0x4400..=0x44FF | 0x4600..=0x46FF if changed == PC => Effect::Indirect,
        _ => Effect::None,
    }
}

fn wide(at: u64, first: u16, second: u16) -> Effect {
    match first {
        0xF000..=0xF7FF if second & 0x8000 != 0 => branch(at, first, second),
        0xF000..=0xF7FF => arithmetic(first, second),
        // Shifted register: a result in SP.
        0xEA00..=0xEBFF if second >> 8 & 0xF == SP => Effect::StackSet,
        0xE92D => Effect::Push(4 * u64::from(second.count_ones())),
        // STMDB through another register is no push; LDM to PC is a return if it is from the stack.
        0xE8BD if second >> 15 == 1 => Effect::Return,
        0xE8BD => Effect::None,
        0xE890..=0xE89F | 0xE8B0..=0xE8BF | 0xE910..=0xE91F | 0xE930..=0xE93F if second >> 15 == 1 => {
            Effect::Indirect
        }
        // STRD [SP, #-n]!
        0xE96D => Effect::Push(4 * u64::from(second & 0xFF)),
        // VPUSH, of either width of register.
        0xED2D | 0xED6D => Effect::Push(4 * u64::from(second & 0xFF)),
        // STRB, STRH, STR [SP, #-n]!
        0xF80D | 0xF82D | 0xF84D if second & 0x0F00 == 0x0D00 => Effect::Push(u64::from(second & 0xFF)),
        // LDR PC: a return if it is popped.
        0xF85D if second == 0xFB04 => Effect::Return,
        0xF850..=0xF85F | 0xF8D0..=0xF8DF if second >> 12 == PC => Effect::Indirect,
        0xF850..=0xF85F | 0xF8D0..=0xF8DF if second >> 12 == SP => Effect::StackSet,
        _ => Effect::None,
    }
}

/// `BL`, `B.W`, `B<cond>.W`, and what shares their space.
fn branch(at: u64, first: u16, second: u16) -> Effect {
    let to = |distance: i64| (at + 4).wrapping_add_signed(distance);
    match second & 0xD000 {
        0xD000 => Effect::Call(to(far(first, second))),
        0x9000 => Effect::Jump(to(far(first, second))),
        0x8000 if first & 0x0380 != 0x0380 => {
            let (j1, j2) = (second >> 13 & 1, second >> 11 & 1);
            let high = signed(first >> 4 & 0x40 | j2 << 5 | j1 << 4, 7);
            Effect::Jump(to(high << 14 | i64::from(first & 0x3F) << 12 | i64::from(second & 0x7FF) << 1))
        }
        // MSR to MSP or PSP.
        0x8000 if first & 0xFFF0 == 0xF380 && matches!(second & 0xFF, 8 | 9) => Effect::StackSet,
        // MSR to PRIMASK.
        0x8000 if first & 0xFFF0 == 0xF380 && second & 0xFF == 16 => Effect::LetIn,
        _ => Effect::None,
    }
}

/// The distance of BL and B.W.
fn far(first: u16, second: u16) -> i64 {
    let (first, second) = (i64::from(first), i64::from(second));
    let sign = first >> 10 & 1;
    let bit_23 = !(second >> 13 ^ sign) & 1;
    let bit_22 = !(second >> 11 ^ sign) & 1;
    let distance = bit_23 << 23 | bit_22 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
    distance - (sign << 24)
}

/// Data processing with a constant: what of it changes the stack pointer.
fn arithmetic(first: u16, second: u16) -> Effect {
    if second >> 8 & 0xF != SP {
        return Effect::None;
    }
    let constant = first << 1 & 0x800 | second >> 4 & 0x700 | second & 0xFF;
    match first & 0xFBFF {
        // SUB.W SP, SP, #n
        0xF1AD | 0xF1BD => Effect::Push(expanded(constant)),
        // SUBW SP, SP, #n
        0xF2AD => Effect::Push(u64::from(constant)),
        // ADD.W and ADDW to SP: it rises.
        0xF10D | 0xF11D | 0xF20D => Effect::None,
        _ => Effect::StackSet,
    }
}

/// ThumbExpandImm: a byte, repeated or rotated.
fn expanded(constant: u16) -> u64 {
    let byte = u32::from(constant & 0xFF);
    let number = match constant >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (byte | 0x80).rotate_right(u32::from(constant >> 7)),
    };
    u64::from(number)
}

/// The lowest `bits` of a number, as a signed one.
fn signed(number: u16, bits: u32) -> i64 {
    let number = i64::from(number);
    if number >> (bits - 1) & 1 == 1 { number - (1 << bits) } else { number }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Effect::{Call, Indirect, Jump, LetIn, None, Push, Return, ShutOut, StackSet, Wait};

    /// Where the instructions stand.
    const AT: u64 = 0x0800_C000;

    fn of(first: u16, second: u16) -> Effect {
        effect(AT, first, second)
    }

    #[test]
    fn long_branches_lead_where_the_reference_manual_says() {
        let to = |distance: i64| AT.wrapping_add_signed(4 + distance);
        assert_eq!(of(0xF7FF, 0xFFFE), Call(to(-4)), "BL to itself");
        assert_eq!(of(0xF000, 0xF800), Call(to(0)), "BL to the instruction behind the next");
        assert_eq!(of(0xF000, 0xB800), Jump(to(0)), "B.W");
        assert_eq!(of(0xF001, 0xF801), Call(to(0x1002)));
        assert_eq!(of(0xF3FF, 0xD7FF), Call(to(0x00FF_FFFE)), "farthest forward");
        assert_eq!(of(0xF400, 0xD000), Call(to(-0x0100_0000)), "farthest back");
        assert_eq!(of(0xF43F, 0xAFFE), Jump(to(-4)), "BEQ.W to itself");
        assert_eq!(of(0xF040, 0x8080), Jump(to(0x100)), "BNE.W");
        assert_eq!(of(0xF3EF, 0x8005), None, "MRS");
    }

    #[test]
    fn short_branches_lead_where_the_reference_manual_says() {
        assert_eq!(of(0xE7FE, 0), Jump(AT), "B to itself");
        assert_eq!(of(0xD0FD, 0), Jump(AT - 2), "BEQ");
        assert_eq!(of(0xB110, 0), Jump(AT + 8), "CBZ r0");
        assert_eq!(of(0xBB10, 0), Jump(AT + 0x48), "CBNZ r0");
        assert_eq!(of(0xDE00, 0), None, "UDF");
    }

    #[test]
    fn jumps_to_who_knows_where_are_told_from_returns() {
        assert_eq!(of(0x4770, 0), Return, "BX LR");
        assert_eq!(of(0xBD80, 0), Return, "POP r7, pc");
        assert_eq!(of(0xE8BD, 0x8FF0), Return, "POP.W r4-r11, pc");
        assert_eq!(of(0xF85D, 0xFB04), Return, "LDR PC, [SP], #4");
        assert_eq!(of(0xE8BD, 0x0FF0), None, "POP.W r4-r11");
        assert_eq!(of(0xE8D0, 0xF003), None, "TBB stays in its function");
        assert_eq!(of(0x4780, 0), Indirect, "BLX r0");
        assert_eq!(of(0x4718, 0), Indirect, "BX r3");
        assert_eq!(of(0x4687, 0), Indirect, "MOV PC, r0");
        assert_eq!(of(0xF8D0, 0xF004), Indirect, "LDR.W PC, [r0, #4]");
        assert_eq!(of(0xE890, 0x8001), Indirect, "LDM r0 to r0, pc");
    }

    #[test]
    fn what_lowers_the_stack_pointer_is_added_up() {
        assert_eq!(of(0xB5F0, 0), Push(20), "PUSH r4-r7, lr");
        assert_eq!(of(0xE92D, 0x0F00), Push(16), "PUSH.W r8-r11");
        assert_eq!(of(0xB082, 0), Push(8), "SUB SP, #8");
        assert_eq!(of(0xF5AD, 0x7D40), Push(768), "SUB.W SP, SP, #768");
        assert_eq!(of(0xF6AD, 0x7DEC), Push(0xFEC), "SUBW SP, SP, #0xFEC");
        assert_eq!(of(0xF84D, 0x8D04), Push(4), "STR r8, [SP, #-4]!");
        assert_eq!(of(0xED2D, 0x8B04), Push(16), "VPUSH d8, d9");
        assert_eq!(of(0xF5AD, 0x5380), None, "SUB.W r3, SP, #4096");
        assert_eq!(of(0xF50D, 0x7D40), None, "ADD.W SP, SP, #768");
        assert_eq!(of(0xB002, 0), None, "ADD SP, #8");
    }

    #[test]
    fn a_stack_pointer_that_is_set_is_told() {
        assert_eq!(of(0x46A5, 0), StackSet, "MOV SP, r4");
        assert_eq!(of(0xF381, 0x8808), StackSet, "MSR MSP, r1");
        assert_eq!(of(0xF1A7, 0x0D10), StackSet, "SUB.W SP, r7, #16");
        assert_eq!(of(0xEBAD, 0x0D03), StackSet, "SUB.W SP, SP, r3");
        assert_eq!(of(0x466F, 0), None, "MOV r7, SP");
    }

    #[test]
    fn what_shuts_interrupts_out_is_told() {
        assert_eq!(of(0xB672, 0), ShutOut, "CPSID i");
        assert_eq!(of(0xB662, 0), LetIn, "CPSIE i");
        assert_eq!(of(0xF380, 0x8810), LetIn, "MSR PRIMASK, r0");
        assert_eq!(of(0xBF30, 0), Wait, "WFI");
    }
}
