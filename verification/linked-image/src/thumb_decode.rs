//! The effect of a Thumb instruction on the flow of control, the stack pointer and the interrupt mask.
//!
//! `yaxpeax-arm` decodes the A and R profiles. So this file adds three things from the ARMv7-M Architecture Reference Manual
//! (DDI 0403): the special registers of `MSR` (B5.2.3), floating-point instructions (A7.5), and what an M-profile core lacks.

use yaxpeax_arch::{Decoder, U8Reader};
use yaxpeax_arm::armv7::{ConditionCode, InstDecoder, Instruction, Opcode, Operand, Reg};

/// The effect of one instruction on the flow of control, the stack or the interrupts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Calls the function at this address.
    Call(u64),
    /// Jumps to this address, always or on a condition.
    Jump(u64),
    /// Returns to the caller: BX LR, or a POP of PC.
    Return,
    /// Jumps or calls to an address that the instruction does not contain.
    Indirect,
    /// Lowers the stack pointer by this many bytes.
    Push(u64),
    /// Sets the stack pointer to a value that the instruction does not contain.
    SetStackPointer,
    /// Sleeps until an interrupt is pending.
    WaitForInterrupt,
    /// Sets PRIMASK.
    DisableInterrupts,
    /// Clears PRIMASK, or writes a register to it.
    EnableInterrupts,
    /// Another instruction, with none of these effects.
    None,
    /// Not an instruction of this core, or not known to the decoder.
    Unknown,
}

const SP: u8 = 13;
const LR: u8 = 14;
const PC: u8 = 15;

/// Bytes of the instruction that begins with this halfword: 2 or 4 (A5.1).
pub(crate) const fn length(first: u16) -> u64 {
    if first >> 11 >= 0b11101 { 4 } else { 2 }
}

/// Decodes the instruction at the beginning of `bytes`.
pub(crate) fn decode(bytes: &[u8]) -> Option<Instruction> {
    InstDecoder::default_thumb().decode(&mut U8Reader::new(bytes)).ok()
}

/// The effect of the instruction at the beginning of `bytes`, which the linker placed at address `at`.
pub(crate) fn effect(at: u64, bytes: &[u8]) -> Effect {
    let [first, second] = [halfword(bytes, 0), halfword(bytes, 2)].map(Option::unwrap_or_default);
    if length(first) == 4 && first & 0xEC00 == 0xEC00 {
        return floating_point(first, second);
    }
    match decode(bytes) {
        Some(instruction) if instruction.opcode == Opcode::MSR => write_special(second),
        Some(instruction) => effect_of(at, length(first), &instruction),
        None => Effect::Unknown,
    }
}

/// The halfword at the byte index `at`.
pub(crate) fn halfword(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().copied().map(u16::from_le_bytes)
}

fn effect_of(at: u64, length: u64, instruction: &Instruction) -> Effect {
    use Opcode::{
        ADD, B, BL, BLX, BX, BXJ, CBNZ, CBZ, CMN, CMP, CPS, CPS_modeonly, HVC, LDM, POP, PUSH, RFE, SETEND,
        SMC, SRS, STR, STRB, STRD, STRH, SUB, TBB, TBH, TEQ, TST, WFI,
    };
    let [first, second, third, _] = instruction.operands;
    // The decoder counts the distance of a short conditional branch (also CBZ and CBNZ) from the next instruction, and all other
    // distances from the address plus 4.
    let is_short_condition = instruction.condition != ConditionCode::AL && length == 2;
    let target = |origin: u64, halfwords: i32| (at + origin).wrapping_add_signed(2 * i64::from(halfwords));
    match (instruction.opcode, first, second) {
        (B, Operand::BranchThumbOffset(distance), _) if is_short_condition => {
            Effect::Jump(target(2, distance))
        }
        (B, Operand::BranchThumbOffset(distance), _) => Effect::Jump(target(4, distance)),
        (BL, Operand::BranchThumbOffset(distance), _) => Effect::Call(target(4, distance)),
        (CBZ | CBNZ, _, Operand::BranchThumbOffset(distance)) => Effect::Jump(target(2, distance)),
        (BX, Operand::Reg(register), _) if register.number() == LR => Effect::Return,
        (BX | BLX, Operand::Reg(_), _) | (TBB | TBH, ..) => Effect::Indirect,
        (BLX | BXJ | RFE(..) | SRS(..) | SMC | HVC | SETEND | CPS_modeonly, ..) => Effect::Unknown,
        (WFI, ..) => Effect::WaitForInterrupt,
        (CPS(true), Operand::Imm12(PRIMASK), _) => Effect::DisableInterrupts,
        (CPS(false), Operand::Imm12(PRIMASK), _) => Effect::EnableInterrupts,
        (PUSH, Operand::RegList(list), _) => Effect::Push(4 * u64::from(list.count_ones())),
        (POP, Operand::RegList(list), _) => {
            if contains_pc(list) {
                Effect::Return
            } else {
                Effect::None
            }
        }
        (LDM(..), _, Operand::RegList(list)) if contains_pc(list) => Effect::Indirect,
        (ADD, Operand::Reg(to), Operand::Reg(from))
            if is_stack(to) && is_stack(from) && is_constant(third) =>
        {
            Effect::None
        }
        (SUB, Operand::Reg(to), Operand::Reg(from)) if is_stack(to) && is_stack(from) => lowered(third),
        // These instructions read their first operand and do not write it.
        (STR | STRB | STRH | STRD | CMP | CMN | TEQ | TST, ..) => {
            moved_stack(instruction).unwrap_or(Effect::None)
        }
        _ => moved_stack(instruction).unwrap_or_else(|| written(first, second)),
    }
}

/// The bit of CPSID and CPSIE that means PRIMASK.
const PRIMASK: u16 = 0b010;

const fn contains_pc(list: u16) -> bool {
    list >> PC & 1 == 1
}

fn is_stack(register: Reg) -> bool {
    register.number() == SP
}

const fn is_constant(operand: Operand) -> bool {
    matches!(operand, Operand::Imm12(_) | Operand::Imm32(_))
}

/// SUB SP, SP, `operand`.
fn lowered(operand: Operand) -> Effect {
    match operand {
        Operand::Imm12(bytes) => Effect::Push(u64::from(bytes)),
        Operand::Imm32(bytes) => Effect::Push(u64::from(bytes)),
        _ => Effect::SetStackPointer,
    }
}

/// A load or a store that lowers the stack pointer by its write-back.
fn moved_stack(instruction: &Instruction) -> Option<Effect> {
    instruction.operands.iter().find_map(|operand| match *operand {
        Operand::RegDerefPreindexOffset(base, bytes, false, true)
        | Operand::RegDerefPostindexOffset(base, bytes, false, true)
            if is_stack(base) =>
        {
            Some(Effect::Push(u64::from(bytes)))
        }
        _ => None,
    })
}

/// The effect of an instruction that writes its first operand.
fn written(first: Operand, second: Operand) -> Effect {
    let Operand::Reg(register) = first else { return Effect::None };
    match (register.number(), second) {
        // LDR PC, [SP], #4 is POP of one register.
        (PC, Operand::RegDerefPostindexOffset(base, 4, true, _)) if is_stack(base) => Effect::Return,
        (PC, _) => Effect::Indirect,
        (SP, _) => Effect::SetStackPointer,
        _ => Effect::None,
    }
}

/// MSR: the low byte of its second halfword selects the special register.
const fn write_special(second: u16) -> Effect {
    match second & 0xFF {
        // MSP, PSP, and CONTROL, which selects one of them.
        8 | 9 | 20 => Effect::SetStackPointer,
        // PRIMASK.
        16 => Effect::EnableInterrupts,
        _ => Effect::None,
    }
}

/// The effect of a coprocessor instruction. Coprocessors 10 and 11 are the floating-point unit; this core has no other.
fn floating_point(first: u16, second: u16) -> Effect {
    let is_floating_point = second >> 9 & 0b111 == 0b101;
    match first & 0xFFBF {
        _ if !is_floating_point => Effect::Unknown,
        // VPUSH; the low byte counts words.
        0xED2D => Effect::Push(4 * u64::from(second & 0xFF)),
        // VLDMDB SP!
        0xED3D => Effect::SetStackPointer,
        _ => Effect::None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Effect::{
        Call, DisableInterrupts, EnableInterrupts, Indirect, Jump, None, Push, Return, SetStackPointer,
        Unknown, WaitForInterrupt,
    };

    /// The address of the instructions.
    const AT: u64 = 0x0800_C000;

    fn of(first: u16, second: u16) -> Effect {
        effect(AT, [first.to_le_bytes(), second.to_le_bytes()].as_flattened())
    }

    #[test]
    fn long_branches_have_the_documented_targets() {
        let to = |distance: i64| AT.wrapping_add_signed(4 + distance);
        assert_eq!(of(0xF7FF, 0xFFFE), Call(to(-4)), "BL to itself");
        assert_eq!(of(0xF000, 0xF800), Call(to(0)), "BL to the next instruction");
        assert_eq!(of(0xF000, 0xB800), Jump(to(0)), "B.W");
        assert_eq!(of(0xF001, 0xF801), Call(to(0x1002)));
        assert_eq!(of(0xF3FF, 0xD7FF), Call(to(0x00FF_FFFE)), "farthest forward");
        assert_eq!(of(0xF400, 0xD000), Call(to(-0x0100_0000)), "farthest back");
        assert_eq!(of(0xF43F, 0xAFFE), Jump(to(-4)), "BEQ.W to itself");
        assert_eq!(of(0xF040, 0x8080), Jump(to(0x100)), "BNE.W");
        assert_eq!(of(0xF3EF, 0x8005), None, "MRS");
    }

    #[test]
    fn short_branches_have_the_documented_targets() {
        assert_eq!(of(0xE7FE, 0), Jump(AT), "B to itself");
        assert_eq!(of(0xD0FD, 0), Jump(AT - 2), "BEQ");
        assert_eq!(of(0xB110, 0), Jump(AT + 8), "CBZ r0");
        assert_eq!(of(0xBB10, 0), Jump(AT + 0x48), "CBNZ r0");
        assert_eq!(of(0xDE00, 0), None, "UDF");
    }

    #[test]
    fn indirect_jumps_differ_from_returns() {
        assert_eq!(of(0x4770, 0), Return, "BX LR");
        assert_eq!(of(0xBD80, 0), Return, "POP r7, pc");
        assert_eq!(of(0xE8BD, 0x8FF0), Return, "POP.W r4-r11, pc");
        assert_eq!(of(0xF85D, 0xFB04), Return, "LDR PC, [SP], #4");
        assert_eq!(of(0xE8BD, 0x0FF0), None, "POP.W r4-r11");
        assert_eq!(of(0xE8DF, 0xF003), Indirect, "TBB [PC, r3]");
        assert_eq!(of(0xE8DF, 0xF013), Indirect, "TBH [PC, r3, LSL #1]");
        assert_eq!(of(0x4780, 0), Indirect, "BLX r0");
        assert_eq!(of(0x4718, 0), Indirect, "BX r3");
        assert_eq!(of(0x4687, 0), Indirect, "MOV PC, r0");
        assert_eq!(of(0x4487, 0), Indirect, "ADD PC, r0");
        assert_eq!(of(0xF8D0, 0xF004), Indirect, "LDR.W PC, [r0, #4]");
        assert_eq!(of(0xF851, 0xF020), Indirect, "LDR.W PC, [r1, r0, LSL #2]");
        assert_eq!(of(0xE890, 0x8001), Indirect, "LDM r0 to r0, pc");
    }

    #[test]
    fn pushes_have_their_size() {
        assert_eq!(of(0xB5F0, 0), Push(20), "PUSH r4-r7, lr");
        assert_eq!(of(0xE92D, 0x0F00), Push(16), "PUSH.W r8-r11");
        assert_eq!(of(0xB082, 0), Push(8), "SUB SP, #8");
        assert_eq!(of(0xF5AD, 0x7D40), Push(768), "SUB.W SP, SP, #768");
        assert_eq!(of(0xF6AD, 0x7DEC), Push(0xFEC), "SUBW SP, SP, #0xFEC");
        assert_eq!(of(0xF84D, 0x8D04), Push(4), "STR r8, [SP, #-4]!");
        assert_eq!(of(0xE96D, 0x0102), Push(8), "STRD r0, r1, [SP, #-8]!");
        assert_eq!(of(0xED2D, 0x8B04), Push(16), "VPUSH d8, d9");
        assert_eq!(of(0xECBD, 0x8B04), None, "VPOP d8, d9");
        assert_eq!(of(0xF5AD, 0x5380), None, "SUB.W r3, SP, #4096");
        assert_eq!(of(0xF50D, 0x7D40), None, "ADD.W SP, SP, #768");
        assert_eq!(of(0xB002, 0), None, "ADD SP, #8");
        assert_eq!(of(0xF8CD, 0xD008), None, "STR SP, [SP, #8]");
    }

    #[test]
    fn writes_to_the_stack_pointer_are_reported() {
        assert_eq!(of(0x46A5, 0), SetStackPointer, "MOV SP, r4");
        assert_eq!(of(0xF381, 0x8808), SetStackPointer, "MSR MSP, r1");
        assert_eq!(of(0xF380, 0x8814), SetStackPointer, "MSR CONTROL, r0");
        assert_eq!(of(0xF1A7, 0x0D10), SetStackPointer, "SUB.W SP, r7, #16");
        assert_eq!(of(0xEBAD, 0x0D03), SetStackPointer, "SUB.W SP, SP, r3");
        assert_eq!(of(0x4485, 0), SetStackPointer, "ADD SP, r0");
        assert_eq!(of(0x466F, 0), None, "MOV r7, SP");
    }

    #[test]
    fn changes_of_the_interrupt_mask_are_reported() {
        assert_eq!(of(0xB672, 0), DisableInterrupts, "CPSID i");
        assert_eq!(of(0xB662, 0), EnableInterrupts, "CPSIE i");
        assert_eq!(of(0xF380, 0x8810), EnableInterrupts, "MSR PRIMASK, r0");
        assert_eq!(of(0xBF30, 0), WaitForInterrupt, "WFI");
    }

    #[test]
    fn instructions_of_other_cores_are_unknown() {
        assert_eq!(of(0xF000, 0xE800), Unknown, "BLX to ARM code");
        assert_eq!(of(0xEE10, 0x0F10), Unknown, "MRC of coprocessor 15");
        assert_eq!(of(0xE990, 0xC000), Unknown, "RFE");
        assert_eq!(of(0xB200 | 0x0480, 0), Unknown, "undefined");
        assert_eq!(effect(AT, &[0]), Unknown, "half an instruction");
    }
}
