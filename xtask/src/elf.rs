//! What the linker put into a program for the chip: sections, functions, who calls whom, and from which
//! line of the source. Knows nothing of what is looked for.

use std::fmt;
use std::path::Path;

use addr2line::gimli::{self, EndianSlice, LittleEndian};
use object::read::elf::ElfFile32;
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use rustc_demangle::demangle;

use crate::run::{Outcome, root};

type Lines<'data> = addr2line::Context<EndianSlice<'data, LittleEndian>>;

/// A linked program.
pub(crate) struct Program<'data> {
    /// Everything that has a name and a size, functions and data.
    pub(crate) symbols: Vec<Symbol>,
    /// The sections that take room on the chip.
    pub(crate) sections: Vec<Section>,
    code: Vec<Code<'data>>,
    lines: Lines<'data>,
}

/// A function or a piece of data.
pub(crate) struct Symbol {
    /// Its name as the source has it.
    pub(crate) name: String,
    /// Where it begins.
    pub(crate) address: u64,
    /// Its length in bytes.
    pub(crate) size: u64,
    /// Is it code?
    pub(crate) is_function: bool,
}

/// A section with room on the chip.
pub(crate) struct Section {
    /// Its name: `.text`.
    pub(crate) name: String,
    /// Its length in bytes.
    pub(crate) size: u64,
}

/// A line of source.
pub(crate) struct Place {
    /// The file: inside the workspace from its root, elsewhere from its package.
    pub(crate) file: String,
    /// Is the file one of this workspace?
    pub(crate) is_ours: bool,
    /// The line's number.
    line: u32,
}

struct Code<'data> {
    start: u64,
    bytes: &'data [u8],
}

impl<'data> Program<'data> {
    /// Reads a linked ELF file.
    pub(crate) fn read(file: &'data [u8]) -> Outcome<Self> {
        let elf: ElfFile32<'_> = ElfFile32::parse(file)?;
        Ok(Self {
            symbols: elf.symbols().filter_map(|symbol| Symbol::of(&symbol)).collect(),
            sections: elf.sections().filter_map(|section| Section::of(&section)).collect(),
            code: code(&elf)?,
            lines: lines(&elf)?,
        })
    }

    /// The addresses from which the code at `target` is called or jumped to.
    pub(crate) fn calls_to(&self, target: u64) -> Vec<u64> {
        let calls = self.code.iter().flat_map(Code::branches);
        calls.filter(|&(_, to)| to == target).map(|(from, _)| from).collect()
    }

    /// The function that holds `address`.
    pub(crate) fn function_at(&self, address: u64) -> Option<&Symbol> {
        let holds = |symbol: &&Symbol| {
            symbol.is_function && (symbol.address..symbol.address + symbol.size).contains(&address)
        };
        self.symbols.iter().find(holds)
    }

    /// The places in the source behind `address`, innermost first: more than one where functions were
    /// inlined.
    pub(crate) fn source_of(&self, address: u64) -> Outcome<Vec<Place>> {
        let mut places = Vec::new();
        let mut frames = self.lines.find_frames(address).skip_all_loads()?;
        while let Some(frame) = frames.next()? {
            if let Some((file, line)) = frame.location.and_then(|place| place.file.zip(place.line)) {
                places.push(Place::new(file, line));
            }
        }
        Ok(places)
    }

    /// Stretches of code that come from one line: address and length in bytes.
    pub(crate) fn stretches(&self) -> Outcome<Vec<(u64, u64)>> {
        let mut stretches = Vec::new();
        for code in &self.code {
            let end = code.start + code.bytes.len() as u64;
            let found = self.lines.find_location_range(code.start, end)?;
            stretches.extend(found.map(|(address, length, _)| (address, length)));
        }
        Ok(stretches)
    }
}

impl Place {
    fn new(path: &str, line: u32) -> Self {
        let ours = Path::new(path).strip_prefix(root()).ok().and_then(Path::to_str);
        let theirs = path.split_once("/library/").or_else(|| path.split_once("/registry/src/index."));
        let file = ours.or(theirs.map(|(_, file)| file)).unwrap_or(path).to_owned();
        Self { file, is_ours: ours.is_some(), line }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", self.file, self.line)
    }
}

impl Symbol {
    fn of<'data>(symbol: &impl ObjectSymbol<'data>) -> Option<Self> {
        let is_function = symbol.kind() == SymbolKind::Text;
        let is_wanted = is_function || symbol.kind() == SymbolKind::Data;
        let name = symbol.name().ok().filter(|name| is_wanted && !name.is_empty())?;
        // Bit 0 of a function's address only says that it is Thumb code.
        let address = if is_function { symbol.address() & !1 } else { symbol.address() };
        Some(Self { name: format!("{:#}", demangle(name)), address, size: symbol.size(), is_function })
    }
}

impl Section {
    fn of<'data>(section: &impl ObjectSection<'data>) -> Option<Self> {
        let object::SectionFlags::Elf { sh_flags, .. } = section.flags() else { return None };
        let takes_room = sh_flags.contains(object::elf::SHF_ALLOC) && section.size() > 0;
        let name = section.name().ok()?.to_owned();
        takes_room.then(|| Self { name, size: section.size() })
    }
}

impl Code<'_> {
    /// Where the long branches of Thumb code are and where they lead: BL (encoding T1) and B.W (T4), ARMv7-M
    /// reference manual A7.7.12 and A7.7.18. Data between functions may look like one; no harm, since only
    /// branches to a known function are asked for.
    fn branches(&self) -> impl Iterator<Item = (u64, u64)> {
        let words = self.bytes.windows(4).zip(self.start..).step_by(2);
        words.filter_map(|(word, at)| {
            let &[a, b, c, d] = word else { return None };
            let offset = branch_offset(u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]))?;
            Some((at, (at + 4).wrapping_add_signed(offset)))
        })
    }
}

/// How far a long branch goes from the address four bytes behind it; `None` for any other instruction.
fn branch_offset(first: u16, second: u16) -> Option<i64> {
    if first & 0xF800 != 0xF000 || second & 0x9000 != 0x9000 {
        return None;
    }
    let (first, second) = (i64::from(first), i64::from(second));
    let sign = first >> 10 & 1;
    let bit_23 = !(second >> 13 ^ sign) & 1;
    let bit_22 = !(second >> 11 ^ sign) & 1;
    let distance = bit_23 << 23 | bit_22 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
    Some(distance - (sign << 24))
}

fn code<'data>(elf: &ElfFile32<'data>) -> Outcome<Vec<Code<'data>>> {
    let sections = elf.sections().filter(|section| section.kind() == object::SectionKind::Text);
    sections.map(|section| Ok(Code { start: section.address(), bytes: section.data()? })).collect()
}

fn lines<'data>(elf: &ElfFile32<'data>) -> Outcome<Lines<'data>> {
    let section = |id: gimli::SectionId| -> Outcome<_> {
        let section = elf.section_by_name(id.name());
        let bytes = section.map_or(Ok([].as_slice()), |section| section.data())?;
        Ok(EndianSlice::new(bytes, LittleEndian))
    };
    Ok(Lines::from_dwarf(gimli::Dwarf::load(section)?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn branches_are_decoded_as_the_reference_manual_has_them() {
        assert_eq!(branch_offset(0xF7FF, 0xFFFE), Some(-4), "BL to itself");
        assert_eq!(branch_offset(0xF000, 0xF800), Some(0), "BL to the instruction behind the next");
        assert_eq!(branch_offset(0xF000, 0xB800), Some(0), "B.W");
        assert_eq!(branch_offset(0xF001, 0xF801), Some(0x1002));
        assert_eq!(branch_offset(0xF3FF, 0xD7FF), Some(0x00FF_FFFE), "farthest forward");
        assert_eq!(branch_offset(0xF400, 0xD000), Some(-0x0100_0000), "farthest back");
        assert_eq!(branch_offset(0xF3EF, 0x8005), None, "MRS");
        assert_eq!(branch_offset(0x4770, 0xF800), None, "BX LR");
    }
}
