//! A NOR flash to test against: stricter than the real one, and the same every time.
//!
//! - Programming takes ones to zeros, word by word. A word that was programmed, or begun, is never programmed
//!   with another value before its sector is erased: that is an error here.
//! - The power can be cut at any operation, where an operation is one word programmed or one sector erased.
//!   What that leaves behind is one of the kinds of [`ProgramTear`] and [`EraseTear`]. From then on nothing
//!   answers until [`Flash::power_up`].
//! - Half charged cells, *marginal* bits, read one way until the power goes, and perhaps another way after.
//! - A sector whose erase was cut looks like anything, even blank. To program it before it was erased in full
//!   is an error.
//! - Erases can be forbidden, sectors and cells wear out, bits rot. Or nothing ever changes, as in an
//!   emulator.
//!
//! It knows nothing of what is stored in it. Cheap to clone, so that a search can try everything that can
//! happen from one state on.

mod access;
mod random;
mod tear;

use std::ops::Range;

pub use access::Error;
pub use random::Random;
use tear::Torn;
pub use tear::{EraseTear, ProgramTear};

/// What changes a flash, and what a power cut can meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// One word.
    Program,
    /// One sector.
    Erase,
}

/// A power cut to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// How many operations are carried out before.
    pub after: usize,
    /// What happens if the next is a program.
    pub program: ProgramTear,
    /// What happens if it is an erase.
    pub erase: EraseTear,
    /// Decides what the tears leave to chance.
    pub seed: u64,
}

/// Bits of the word at an address.
#[derive(Clone, Copy, Debug)]
struct Bits {
    address: usize,
    mask: u32,
}

/// A flash of sectors of `SECTOR` bytes and words of `WORD` bytes, four at most.
#[derive(Clone, Debug)]
pub struct Flash<const SECTOR: usize, const WORD: usize = 4> {
    /// What is read at present.
    cells: Vec<u8>,
    /// What each word was told to hold since its sector was erased.
    told: Vec<u8>,
    /// Bits that may read otherwise after the next start.
    marginal: Vec<Bits>,
    /// Bits that stay ones whatever they are told.
    unprogrammable: Vec<Bits>,
    /// Since the power was last switched on.
    history: Vec<Operation>,
    /// Sets of sectors, bit n for sector n.
    half_erased: u64,
    worn_out: u64,
    cut: Option<Cut>,
    powered: bool,
    inert: bool,
    erase_forbidden: bool,
    told_again: usize,
}

impl<const SECTOR: usize, const WORD: usize> Flash<SECTOR, WORD> {
    /// A new flash of some sectors, 64 at most: blank, and powered.
    #[must_use]
    pub fn new(sectors: usize) -> Self {
        const { assert!(SECTOR.is_multiple_of(WORD) && WORD <= 4) };
        Self::holding(&vec![0xFF; SECTOR * sectors])
    }

    /// A flash that holds these bytes: whole sectors.
    #[must_use]
    pub fn holding(bytes: &[u8]) -> Self {
        Self {
            cells: bytes.to_vec(),
            told: bytes.to_vec(),
            marginal: Vec::new(),
            unprogrammable: Vec::new(),
            history: Vec::new(),
            half_erased: 0,
            worn_out: 0,
            cut: None,
            powered: true,
            inert: false,
            erase_forbidden: false,
            told_again: 0,
        }
    }

    /// A flash that takes every command and does nothing: it holds these bytes for ever.
    #[must_use]
    pub fn inert(bytes: &[u8]) -> Self {
        Self { inert: true, ..Self::holding(bytes) }
    }

    /// What is read at present.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.cells
    }

    /// What was done since the power was last switched on.
    #[must_use]
    pub fn history(&self) -> &[Operation] {
        &self.history
    }

    /// How many operations of one kind that was.
    #[must_use]
    pub fn count(&self, operation: Operation) -> usize {
        self.history.iter().filter(|done| **done == operation).count()
    }

    /// How many words were told again what they had been told before, since this flash is there.
    #[must_use]
    pub const fn told_again(&self) -> usize {
        self.told_again
    }

    /// Is the power on?
    #[must_use]
    pub const fn is_powered(&self) -> bool {
        self.powered
    }

    /// Switches the power off and on: marginal bits read as `start` decides, and a cut to come is called off.
    pub fn power_up(&mut self, start: u64) {
        self.powered = true;
        self.cut = None;
        self.erase_forbidden = false;
        self.history.clear();
        for Bits { address, mask } in self.marginal.clone() {
            let reads = Random::new(start ^ (address as u64) << 40).word();
            self.alter(address, |cells| cells & !mask | reads & mask);
        }
    }

    /// Cuts the power at an operation to come.
    pub const fn cut_power(&mut self, cut: Cut) {
        self.cut = Some(cut);
    }

    /// From now to the next start an erase is an error.
    pub const fn forbid_erase(&mut self) {
        self.erase_forbidden = true;
    }

    /// A bit changes by itself. Bits count from the lowest of byte 0.
    pub fn flip(&mut self, bit: usize) {
        if let Some(byte) = self.cells.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// From now on this bit cannot be programmed to 0.
    pub fn wear_out_bit(&mut self, bit: usize) {
        let address = bit / 8 / WORD * WORD;
        self.unprogrammable.push(Bits { address, mask: 1 << (bit - address * 8) });
    }

    /// From now on an erase does nothing to this sector.
    pub const fn wear_out_sector(&mut self, sector: usize) {
        self.worn_out |= 1 << sector;
    }

    /// Counts an operation; the cut, if it meets this one.
    fn step(&mut self, operation: Operation) -> Option<Cut> {
        let cut = self.cut.filter(|cut| cut.after == 0);
        if let Some(cut) = &mut self.cut {
            cut.after = cut.after.saturating_sub(1);
        }
        self.powered = cut.is_none();
        self.history.push(operation);
        cut
    }

    const fn check_power(&self) -> Result<(), Error> {
        if self.powered { Ok(()) } else { Err(Error::PowerLost) }
    }

    fn alter(&mut self, address: usize, change: impl FnOnce(u32) -> u32) {
        if let Some(cells) = self.cells.get_mut(address..address + WORD) {
            let bytes = change(word(cells)).to_le_bytes();
            cells.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell = byte);
        }
    }

    fn apply(&mut self, address: usize, torn: Torn) {
        self.alter(address, |cells| cells & !torn.cleared | torn.set);
        for bits in self.marginal.iter_mut().filter(|bits| bits.address == address) {
            bits.mask &= !(torn.cleared | torn.set);
        }
        self.marginal.retain(|bits| bits.mask != 0);
        if torn.marginal != 0 {
            self.marginal.push(Bits { address, mask: torn.marginal });
        }
    }

    /// The bits of a word in one of the lists.
    fn bits(list: &[Bits], address: usize) -> u32 {
        list.iter().filter(|bits| bits.address == address).fold(0, |mask, bits| mask | bits.mask)
    }

    fn program(&mut self, address: usize, new: &[u8]) -> Result<(), Error> {
        self.check_power()?;
        if self.half_erased >> (address / SECTOR) & 1 == 1 {
            return Err(Error::HalfErased);
        }
        self.tell(address, new)?;
        let old = self.cells.get(address..address + WORD).map_or(0, word);
        let charged = old | Self::bits(&self.marginal, address);
        let bits = charged & !word(new) & !Self::bits(&self.unprogrammable, address);
        let Some(cut) = self.step(Operation::Program) else {
            self.apply(address, Torn { cleared: bits, ..Torn::default() });
            return Ok(());
        };
        self.apply(address, cut.program.tear(bits, &mut Random::new(cut.seed)));
        Err(Error::PowerLost)
    }

    /// Notes what a word is told to hold.
    fn tell(&mut self, address: usize, new: &[u8]) -> Result<(), Error> {
        let told = self.told.get_mut(address..address + WORD).unwrap_or_default();
        let is_blank = |word: &[u8]| word.iter().all(|byte| *byte == 0xFF);
        if is_blank(told) {
            told.copy_from_slice(new);
        } else if told == new {
            self.told_again += 1;
        } else {
            return Err(Error::ProgrammedTwice);
        }
        Ok(())
    }

    fn erase_sector(&mut self, sector: usize) -> Result<(), Error> {
        self.check_power()?;
        if self.erase_forbidden {
            return Err(Error::EraseForbidden);
        }
        let cut = self.step(Operation::Erase);
        if self.worn_out >> sector & 1 == 0 {
            self.erase_cells(sector, cut);
        }
        if cut.is_some() { Err(Error::PowerLost) } else { Ok(()) }
    }

    fn erase_cells(&mut self, sector: usize, cut: Option<Cut>) {
        let range = sector * SECTOR..(sector + 1) * SECTOR;
        match cut {
            Some(Cut { erase: EraseTear::Nothing, .. }) => {}
            Some(cut) if cut.erase != EraseTear::All => {
                self.half_erased |= 1 << sector;
                self.tear_sector(range, cut);
            }
            _ => {
                self.half_erased &= !(1 << sector);
                self.told.get_mut(range.clone()).unwrap_or_default().fill(0xFF);
                self.cells.get_mut(range.clone()).unwrap_or_default().fill(0xFF);
                self.marginal.retain(|bits| !range.contains(&bits.address));
            }
        }
    }

    fn tear_sector(&mut self, range: Range<usize>, cut: Cut) {
        for Bits { address, mask } in self.marginal.clone() {
            if range.contains(&address) {
                self.apply(address, Torn { set: mask, ..Torn::default() });
            }
        }
        let cells = self.cells.get(range.clone()).unwrap_or_default();
        let words: Vec<_> = cells.chunks(WORD).map(word).collect();
        let torn = cut.erase.tear(&words, &mut Random::new(cut.seed));
        range.step_by(WORD).zip(torn).for_each(|(address, torn)| self.apply(address, torn));
    }
}

/// A word's bytes as a number; bytes that it does not have are 0.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

#[cfg(test)]
mod tests;
