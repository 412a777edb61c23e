//! The targets of a compiler's jump tables, read from the code of a function.
//!
//! ```text
//!   TBB [PC, r0]              TBH [PC, r0, LSL #1]         ADR   r1, table
//!   table: bytes              table: halfwords             ADD.W r2, r1, r0, LSL #2
//!   target: table + 2 * n     target: table + 2 * n        MOV   PC, r2
//!                                                          table: B.W, B.W, ...
//! ```
//!
//! The compiled code checks the index before the jump. Any other indirect jump has no known targets.

use yaxpeax_arm::armv7::{ConditionCode, Instruction, Opcode, Operand, RegShiftStyle, ShiftStyle};

use crate::thumb_decode::{self, decode};

pub(crate) struct FunctionCode<'a> {
    /// The address of its first byte.
    pub(crate) start: u64,
    /// Its instructions and data.
    pub(crate) bytes: &'a [u8],
    /// The address of each instruction, in order.
    pub(crate) instructions: &'a [u64],
}

const PC: u8 = 15;
/// How many instructions before the use of a register are searched for the instruction that writes the register.
const MOST_BETWEEN: usize = 8;

impl FunctionCode<'_> {
    /// The targets of the indirect jump at `at`; `None` if it uses no table that can be read.
    pub(crate) fn targets(&self, at: u64) -> Option<Vec<u64>> {
        let targets = match self.instruction(at)?.opcode {
            Opcode::TBB => self.byte_offsets(at),
            Opcode::TBH => self.halfword_offsets(at),
            Opcode::MOV => self.branches(at),
            _ => None,
        }?;
        let are_code = targets.iter().all(|target| self.instructions.binary_search(target).is_ok());
        (are_code && !targets.is_empty()).then_some(targets)
    }

    /// The table after TBB or TBH: the bytes from the end of this instruction to the next instruction.
    fn table_behind(&self, at: u64) -> Option<&[u8]> {
        let is_relative_to_pc = match self.instruction(at)?.operands.first()? {
            Operand::RegDerefPreindexReg(base, ..) | Operand::RegDerefPreindexRegShift(base, ..) => {
                base.number() == PC
            }
            _ => false,
        };
        let next = self.instructions.iter().find(|&&next| next > at)?;
        is_relative_to_pc.then(|| self.bytes.get(self.index(at + 4)?..self.index(*next)?))?
    }

    fn byte_offsets(&self, at: u64) -> Option<Vec<u64>> {
        let table = self.table_behind(at)?;
        // A zero byte may align the next instruction.
        let offsets = table.strip_suffix(&[0]).unwrap_or(table);
        Some(offsets.iter().map(|&offset| at + 4 + 2 * u64::from(offset)).collect())
    }

    fn halfword_offsets(&self, at: u64) -> Option<Vec<u64>> {
        let offsets = self.table_behind(at)?.as_chunks().0.iter().map(|&bytes| u16::from_le_bytes(bytes));
        Some(offsets.map(|offset| at + 4 + 2 * u64::from(offset)).collect())
    }

    /// The addresses of the branches from which `MOV PC, rN` selects.
    fn branches(&self, at: u64) -> Option<Vec<u64>> {
        let register = source(&self.instruction(at)?)?;
        let add = self.last_write(register, at)?;
        let base = self.last_write(index_step(&self.instruction(add)?)?, add)?;
        let table = address_of_table(base, &self.instruction(base)?)?;
        let entries = (0..).map(|number| table + 4 * number);
        Some(entries.take_while(|&entry| self.is_long_branch(entry)).collect())
    }

    /// The last of the [`MOST_BETWEEN`] instructions before `at` that has `register` as its first operand.
    fn last_write(&self, register: u8, at: u64) -> Option<u64> {
        let end = self.instructions.binary_search(&at).ok()?;
        let near = self.instructions.get(end.saturating_sub(MOST_BETWEEN)..end)?;
        near.iter().copied().rev().find(|&at| {
            self.instruction(at).is_some_and(|instruction| {
                matches!(instruction.operands.first(), Some(Operand::Reg(to)) if to.number() == register)
            })
        })
    }

    /// True if the instruction at `at` is an unconditional branch of 4 bytes.
    fn is_long_branch(&self, at: u64) -> bool {
        let is_start = self.instructions.binary_search(&at).is_ok();
        let bytes = self.index(at).and_then(|index| self.bytes.get(index..)).unwrap_or_default();
        let is_long = thumb_decode::halfword(bytes, 0).is_some_and(|first| thumb_decode::length(first) == 4);
        let is_branch = |instruction: Instruction| {
            instruction.opcode == Opcode::B && instruction.condition == ConditionCode::AL
        };
        is_start && is_long && decode(bytes).is_some_and(is_branch)
    }

    fn instruction(&self, at: u64) -> Option<Instruction> {
        decode(self.bytes.get(self.index(at)?..)?)
    }

    fn index(&self, at: u64) -> Option<usize> {
        usize::try_from(at.checked_sub(self.start)?).ok()
    }
}

/// `ADR rN, table`: the table's address.
fn address_of_table(at: u64, instruction: &Instruction) -> Option<u64> {
    // PC reads as the address of this instruction plus 4, rounded down to a word (ARMv7-M reference
    // manual, A4.2.1).
    let pc = (at + 4) & !3;
    match (instruction.opcode, instruction.operands) {
        (Opcode::ADR, [_, Operand::Imm32(offset), ..]) => Some(pc + u64::from(offset)),
        (Opcode::ADD, [_, Operand::Reg(base), offset, _]) if base.number() == PC => match offset {
            Operand::Imm32(offset) => Some(pc + u64::from(offset)),
            Operand::Imm12(offset) => Some(pc + u64::from(offset)),
            _ => None,
        },
        _ => None,
    }
}

/// `ADD.W rN, rB, rM, LSL #2`: the register rB.
fn index_step(instruction: &Instruction) -> Option<u8> {
    let (Opcode::ADD, [_, Operand::Reg(base), Operand::RegShift(index), _]) =
        (instruction.opcode, instruction.operands)
    else {
        return None;
    };
    let RegShiftStyle::RegImm(shift) = index.into_shift() else { return None };
    (shift.stype() == ShiftStyle::LSL && shift.imm() == 2).then(|| base.number())
}

/// `MOV PC, rN`: the register rN.
fn source(instruction: &Instruction) -> Option<u8> {
    match instruction.operands {
        [Operand::Reg(to), Operand::Reg(from), ..] if to.number() == PC => Some(from.number()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: u64 = 0x0800_1000;

    /// The targets of the jump at index `jump` of the halfwords, in bytes from the start. The halfwords with an index in `data`
    /// are no instructions.
    fn targets(code: &[u16], jump: u64, data: std::ops::Range<u64>) -> Option<Vec<u64>> {
        let bytes: Vec<_> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        let mut instructions = Vec::new();
        let mut at = 0;
        while let Some(first) = thumb_decode::halfword(&bytes, usize::try_from(at).unwrap()) {
            let is_data = data.contains(&(at / 2));
            if !is_data {
                instructions.push(START + at);
            }
            at += if is_data { 2 } else { thumb_decode::length(first) };
        }
        let body = FunctionCode { start: START, bytes: &bytes, instructions: &instructions };
        let targets = body.targets(START + 2 * jump)?;
        Some(targets.into_iter().map(|target| target - START).collect())
    }

    #[test]
    fn a_table_of_bytes_is_read_to_the_next_instruction() {
        // TBB [PC, r0]; 2, 3, 4 and an aligning byte; BX LR three times.
        let code = [0xE8DF, 0xF000, 0x0302, 0x0004, 0x4770, 0x4770, 0x4770];
        assert_eq!(targets(&code, 0, 2..4), Some(vec![8, 10, 12]));
    }

    #[test]
    fn a_table_of_halfwords_is_read_to_the_next_instruction() {
        // TBH [PC, r0, LSL #1]; 2, 3; BX LR twice.
        let code = [0xE8DF, 0xF010, 2, 3, 0x4770, 0x4770];
        assert_eq!(targets(&code, 0, 2..4), Some(vec![8, 10]));
    }

    #[test]
    fn a_table_of_branches_is_read_to_its_last_branch() {
        // ADR r1, table; ADD.W r1, r1, r0, LSL #2; MOV PC, r1; table: B.W, B.W; BX LR.
        let code = [0xA101, 0xEB01, 0x0180, 0x468F, 0xF000, 0xB802, 0xF000, 0xB800, 0x4770];
        assert_eq!(targets(&code, 3, 0..0), Some(vec![8, 12]));
        let other_register = [0xA101, 0xEB02, 0x0280, 0x468F, 0xF000, 0xB802, 0xF000, 0xB800, 0x4770];
        assert_eq!(targets(&other_register, 3, 0..0), None);
        let other_step = [0xA101, 0xEB01, 0x0140, 0x468F, 0xF000, 0xB802, 0xF000, 0xB800, 0x4770];
        assert_eq!(targets(&other_step, 3, 0..0), None);
        let no_branches = [0xA101, 0xEB01, 0x0180, 0x468F, 0x4770, 0x4770];
        assert_eq!(targets(&no_branches, 3, 0..0), None);
    }

    #[test]
    fn a_table_with_targets_outside_the_code_is_refused() {
        let into_the_table = [0xE8DF, 0xF010, 0, 3, 0x4770, 0x4770];
        assert_eq!(targets(&into_the_table, 0, 2..4), None);
        let behind_the_function = [0xE8DF, 0xF010, 2, 9, 0x4770, 0x4770];
        assert_eq!(targets(&behind_the_function, 0, 2..4), None);
        let no_table = [0xE8DF, 0xF010, 0x4770];
        assert_eq!(targets(&no_table, 0, 0..0), None);
        let other_base = [0xE8D1, 0xF010, 2, 3, 0x4770, 0x4770];
        assert_eq!(targets(&other_base, 0, 2..4), None);
    }

    #[test]
    fn calls_through_pointers_have_no_targets() {
        for code in [[0x4780, 0x4770], [0x4718, 0x4770], [0x4687, 0x4770]] {
            assert_eq!(targets(&code, 0, 0..0), None, "{code:x?}");
        }
    }
}
