//! A linked program for the chip: sections, functions, calls, and lines of source.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::ops::Range;
use std::path::Path;

use addr2line::gimli::{self, EndianSlice, LittleEndian};
use object::read::elf::ElfFile32;
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use rustc_demangle::demangle;

use crate::ReadResult;
use crate::jump_table::FunctionCode;
use crate::thumb_decode::{self, Effect, halfword};

type SourceLines<'data> = addr2line::Context<EndianSlice<'data, LittleEndian>>;

/// A linked program for the chip: its symbols, its instructions and their lines of source.
pub struct Program<'data> {
    /// Functions and data with a name. The size of some is 0: see [`Self::functions`].
    pub symbols: Vec<Symbol>,
    /// The sections in the chip's memory.
    pub sections: Vec<Section>,
    code: Vec<CodeSection<'data>>,
    /// The effect of the instruction at each address.
    instructions: BTreeMap<u64, Effect>,
    /// The addresses of the exception handlers, reset first, each handler once.
    handlers: Vec<u64>,
    lines: SourceLines<'data>,
}

/// A function or a piece of data.
pub struct Symbol {
    /// Its demangled name, without the hash.
    pub name: String,
    /// The address of its first byte, without the bit that marks Thumb code.
    pub address: u64,
    /// Its length in bytes.
    pub size: u64,
    /// True for a function, false for data.
    pub is_function: bool,
}

/// A section in the chip's memory.
pub struct Section {
    /// Its name, such as `.text`.
    pub name: String,
    /// The address of its first byte while the program runs.
    pub address: u64,
    /// Its length in bytes.
    pub size: u64,
}

/// The place in the source that an instruction comes from. It prints as `file:line`.
pub struct SourceLine {
    /// The file: its path in the workspace, or in the folder of its library or registry.
    pub file: String,
    /// True for a file of this workspace.
    pub is_ours: bool,
    line: u32,
}

struct CodeSection<'data> {
    start: u64,
    bytes: &'data [u8],
    /// The data between the instructions: constants and jump tables.
    data: Vec<Range<u64>>,
}

impl<'data> Program<'data> {
    /// Reads a 32-bit ELF file. Fails if the file has no vector table.
    pub fn read(file: &'data [u8]) -> ReadResult<Self> {
        let elf: ElfFile32<'_> = ElfFile32::parse(file)?;
        let code = code(&elf)?;
        Ok(Self {
            symbols: elf.symbols().filter_map(|symbol| Symbol::of(&symbol)).collect(),
            sections: elf.sections().filter_map(|section| Section::of(&section)).collect(),
            instructions: code.iter().flat_map(CodeSection::instructions).collect(),
            code,
            handlers: handlers(&elf)?,
            lines: lines(&elf)?,
        })
    }

    /// The addresses of the direct calls and jumps to `target`.
    pub fn calls_to(&self, target: u64) -> Vec<u64> {
        let leads_there = |effect| matches!(effect, Effect::Call(to) | Effect::Jump(to) if to == target);
        let calls = self.instructions.iter().filter(|&(_, &effect)| leads_there(effect));
        calls.map(|(&at, _)| at).collect()
    }

    /// The functions. Symbols without a size, such as aliases in a linker script, are left out.
    pub fn functions(&self) -> impl Iterator<Item = &Symbol> {
        self.symbols.iter().filter(|symbol| symbol.is_function && symbol.size > 0)
    }

    /// The instructions of a function: address and effect.
    pub fn instructions_of(&self, function: &Symbol) -> impl Iterator<Item = (u64, Effect)> {
        self.instructions.range(function.range()).map(|(&at, &effect)| (at, effect))
    }

    /// The targets of the indirect jump at `at` in a function; `None` if they cannot be read from the image.
    pub fn jump_targets(&self, function: &Symbol, at: u64) -> Option<Vec<u64>> {
        let code = self.code.iter().find(|code| function.address >= code.start)?;
        let first = usize::try_from(function.address - code.start).ok()?;
        let bytes = code.bytes.get(first..)?.get(..usize::try_from(function.size).ok()?)?;
        let instructions: Vec<_> = self.instructions_of(function).map(|(at, _)| at).collect();
        FunctionCode { start: function.address, bytes, instructions: &instructions }.targets(at)
    }

    /// The addresses of the instructions with this effect.
    pub fn addresses_of(&self, effect: Effect) -> Vec<u64> {
        self.instructions.iter().filter(|&(_, &other)| other == effect).map(|(&at, _)| at).collect()
    }

    /// The address of the instruction that precedes the one at `address`.
    pub fn instruction_before(&self, address: u64) -> Option<u64> {
        self.instructions.range(..address).next_back().map(|(&at, _)| at)
    }

    /// The effect of the instruction at each address.
    pub fn effects(&self) -> HashMap<u64, Effect> {
        self.instructions.iter().map(|(&at, &effect)| (at, effect)).collect()
    }

    /// The address of the function with this name.
    pub fn address_of(&self, name: &str) -> ReadResult<u64> {
        let symbol = self.functions().find(|symbol| symbol.name == name);
        Ok(symbol.ok_or_else(|| format!("no function is called {name}"))?.address)
    }

    /// The addresses of the exception handlers, reset first, each handler once.
    pub fn handlers(&self) -> &[u64] {
        &self.handlers
    }

    /// The function that contains `address`; `None` for data, and for code without a symbol.
    pub fn function_at(&self, address: u64) -> Option<&Symbol> {
        self.symbols.iter().find(|symbol| symbol.is_function && symbol.holds(address))
    }

    /// The lines of source for `address`, innermost first. There are several for inlined functions.
    pub fn source_of(&self, address: u64) -> ReadResult<Vec<SourceLine>> {
        let mut places = Vec::new();
        let mut frames = self.lines.find_frames(address).skip_all_loads()?;
        while let Some(frame) = frames.next()? {
            if let Some((file, line)) = frame.location.and_then(|place| place.file.zip(place.line)) {
                places.push(SourceLine::new(file, line));
            }
        }
        Ok(places)
    }

    /// The ranges of code that each come from one line of source: address and length in bytes.
    pub fn line_ranges(&self) -> ReadResult<Vec<(u64, u64)>> {
        let mut line_ranges = Vec::new();
        for code in &self.code {
            let end = code.start + code.bytes.len() as u64;
            let found = self.lines.find_location_range(code.start, end)?;
            line_ranges.extend(found.map(|(address, length, _)| (address, length)));
        }
        Ok(line_ranges)
    }
}

impl SourceLine {
    fn new(path: &str, line: u32) -> Self {
        // This crate and the program are in the same workspace.
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap_or(Path::new("/"));
        let ours = Path::new(path).strip_prefix(root).ok().and_then(Path::to_str);
        let theirs = path.split_once("/library/").or_else(|| path.split_once("/registry/src/index."));
        let file = ours.or(theirs.map(|(_, file)| file)).unwrap_or(path).to_owned();
        Self { file, is_ours: ours.is_some(), line }
    }
}

impl fmt::Display for SourceLine {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", self.file, self.line)
    }
}

impl Symbol {
    fn of<'data>(symbol: &impl ObjectSymbol<'data>) -> Option<Self> {
        let is_function = symbol.kind() == SymbolKind::Text;
        let is_wanted = is_function || symbol.kind() == SymbolKind::Data;
        let name = symbol.name().ok().filter(|name| is_wanted && !name.is_empty())?;
        // Bit 0 of a function's address marks Thumb code.
        let address = if is_function { symbol.address() & !1 } else { symbol.address() };
        Some(Self { name: format!("{:#}", demangle(name)), address, size: symbol.size(), is_function })
    }
}

impl Symbol {
    /// True if this function or data contains `address`.
    pub fn holds(&self, address: u64) -> bool {
        self.range().contains(&address)
    }

    const fn range(&self) -> Range<u64> {
        self.address..self.address + self.size
    }
}

impl Section {
    fn of<'data>(section: &impl ObjectSection<'data>) -> Option<Self> {
        let object::SectionFlags::Elf { sh_flags, .. } = section.flags() else { return None };
        let takes_room = sh_flags.contains(object::elf::SHF_ALLOC) && section.size() > 0;
        let name = section.name().ok()?.to_owned();
        takes_room.then(|| Self { name, address: section.address(), size: section.size() })
    }
}

impl CodeSection<'_> {
    /// The address and the effect of each instruction, without the data between them.
    fn instructions(&self) -> impl Iterator<Item = (u64, Effect)> {
        let mut rest = self.bytes;
        let mut at = self.start;
        std::iter::from_fn(move || {
            while let Some(data) = self.data.iter().find(|data| data.contains(&at)) {
                rest = rest.get(usize::try_from(data.end - at).ok()?..)?;
                at = data.end;
            }
            let here = at;
            let length = thumb_decode::length(halfword(rest, 0)?);
            let effect = thumb_decode::effect(here, rest);
            rest = rest.get(usize::try_from(length).ok()?..)?;
            at += length;
            Some((here, effect))
        })
    }
}

fn code<'data>(elf: &ElfFile32<'data>) -> ReadResult<Vec<CodeSection<'data>>> {
    let marks = marks(elf);
    let sections = elf.sections().filter(|section| section.kind() == object::SectionKind::Text);
    sections
        .map(|section| {
            let (start, bytes) = (section.address(), section.data()?);
            let end = start + bytes.len() as u64;
            let stops = marks.iter().skip(1).map(|&(at, _)| at).chain([end]);
            let line_ranges = marks.iter().zip(stops).filter(|((at, _), _)| (start..end).contains(at));
            let data = line_ranges.filter(|((_, is_code), _)| !is_code).map(|(&(at, _), stop)| at..stop);
            Ok(CodeSection { start, bytes, data: data.collect() })
        })
        .collect()
}

/// The addresses at which instructions (true) or data (false) begin, in ascending order, from the mapping symbols of the ELF
/// for the ARM architecture.
fn marks(elf: &ElfFile32<'_>) -> Vec<(u64, bool)> {
    let mut marks: Vec<_> = elf
        .symbols()
        .filter_map(|symbol| match symbol.name().ok()? {
            "$t" => Some((symbol.address(), true)),
            "$d" => Some((symbol.address(), false)),
            name if name.starts_with("$t.") => Some((symbol.address(), true)),
            name if name.starts_with("$d.") => Some((symbol.address(), false)),
            _ => None,
        })
        .collect();
    marks.sort_unstable();
    marks
}

/// The handlers in the vector table, each once, without the initial stack pointer and unused entries.
fn handlers(elf: &ElfFile32<'_>) -> ReadResult<Vec<u64>> {
    let table = elf.section_by_name(".vector_table").ok_or("no vector table")?.data()?;
    let mut handlers = Vec::new();
    for word in table.as_chunks().0.iter().skip(1) {
        let handler = u64::from(u32::from_le_bytes(*word)) & !1;
        if handler != 0 && !handlers.contains(&handler) {
            handlers.push(handler);
        }
    }
    Ok(handlers)
}

fn lines<'data>(elf: &ElfFile32<'data>) -> ReadResult<SourceLines<'data>> {
    let section = |id: gimli::SectionId| -> ReadResult<_> {
        let section = elf.section_by_name(id.name());
        let bytes = section.map_or(Ok([].as_slice()), |section| section.data())?;
        Ok(EndianSlice::new(bytes, LittleEndian))
    };
    Ok(SourceLines::from_dwarf(gimli::Dwarf::load(section)?)?)
}
