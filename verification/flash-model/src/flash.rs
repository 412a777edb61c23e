//! The cells of the flash, and the effect of each operation and each power cut on them.

use std::ops::Range;

use crate::error::Error;
use crate::power_cut::{EraseTear, ProgramTear, Torn};
use crate::random::Random;

/// An operation that changes the flash, and that a power cut can interrupt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// One word is programmed.
    Program,
    /// One sector is erased.
    Erase,
}

/// A future power cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Number of operations that complete before the cut, from the call of [`Flash::cut_power`] on.
    pub after: usize,
    /// The result if the cut interrupts a program operation.
    pub program: ProgramTear,
    /// The result if the cut interrupts an erase.
    pub erase: EraseTear,
    /// Seed of the random choices of the tear.
    pub seed: u64,
}

/// Some bits of the word at an address.
#[derive(Clone, Copy, Debug)]
struct Bits {
    address: usize,
    mask: u32,
}

/// A flash with sectors of `SECTOR` bytes and words of `WORD` bytes, at most four.
#[derive(Clone, Debug)]
pub struct Flash<const SECTOR: usize, const WORD: usize = 4> {
    cells: Vec<u8>,
    /// For each word, the value that a program operation requested, or its value at the start. All ones after a complete erase.
    requested: Vec<u8>,
    /// Bits that may read differently after the next power-up.
    marginal: Vec<Bits>,
    /// Worn bits that programming does not change.
    unprogrammable: Vec<Bits>,
    /// The operations since the last power-up.
    history: Vec<Operation>,
    /// Sectors whose erase was cut half way, bit n for sector n.
    half_erased: u64,
    /// Sectors that an erase does not change, bit n for sector n.
    worn_out: u64,
    cut: Option<Cut>,
    powered: bool,
    inert: bool,
    erase_forbidden: bool,
    reprogrammed: usize,
}

impl<const SECTOR: usize, const WORD: usize> Flash<SECTOR, WORD> {
    /// A blank flash with this number of sectors, at most 64. Its power is on.
    #[must_use]
    pub fn new(sectors: usize) -> Self {
        const { assert!(SECTOR.is_multiple_of(WORD) && WORD <= 4) };
        Self::holding(&vec![0xFF; SECTOR * sectors])
    }

    /// A flash with these contents, whose length must be a multiple of `SECTOR`.
    #[must_use]
    pub fn holding(bytes: &[u8]) -> Self {
        Self {
            cells: bytes.to_vec(),
            requested: bytes.to_vec(),
            marginal: Vec::new(),
            unprogrammable: Vec::new(),
            history: Vec::new(),
            half_erased: 0,
            worn_out: 0,
            cut: None,
            powered: true,
            inert: false,
            erase_forbidden: false,
            reprogrammed: 0,
        }
    }

    /// A flash with these contents that accepts every valid program and erase, and changes nothing.
    #[must_use]
    pub fn inert(bytes: &[u8]) -> Self {
        Self { inert: true, ..Self::holding(bytes) }
    }

    /// The bytes as they read now, from address 0 on.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.cells
    }

    /// The operations since the last power-up.
    #[must_use]
    pub fn history(&self) -> &[Operation] {
        &self.history
    }

    /// Number of operations of one kind since the last power-up.
    #[must_use]
    pub fn count(&self, operation: Operation) -> usize {
        self.history.iter().filter(|done| **done == operation).count()
    }

    /// Number of times that a word was programmed again with the same value, since the flash was created.
    #[must_use]
    pub const fn reprogrammed(&self) -> usize {
        self.reprogrammed
    }

    /// True if the power is on.
    #[must_use]
    pub const fn is_powered(&self) -> bool {
        self.powered
    }

    /// Switches the power off and on. The seed `start` decides how marginal bits read. Cancels a planned cut, permits erases,
    /// and clears the history.
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

    /// Plans a power cut. It replaces a cut that was planned before.
    pub const fn cut_power(&mut self, cut: Cut) {
        self.cut = Some(cut);
    }

    /// Makes each erase an error until the next power-up.
    pub const fn forbid_erase(&mut self) {
        self.erase_forbidden = true;
    }

    /// Inverts a bit. Bit 0 is the lowest bit of byte 0.
    pub fn flip(&mut self, bit: usize) {
        if let Some(byte) = self.cells.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
    }

    /// Wears a bit out: programming cannot change it to 0 any more.
    pub fn wear_out_bit(&mut self, bit: usize) {
        let address = bit / 8 / WORD * WORD;
        self.unprogrammable.push(Bits { address, mask: 1 << (bit - address * 8) });
    }

    /// Wears a sector out: an erase does not change it any more.
    pub const fn wear_out_sector(&mut self, sector: usize) {
        self.worn_out |= 1 << sector;
    }

    /// Records an operation. If the planned cut interrupts it, switches the power off and returns the cut.
    fn step(&mut self, operation: Operation) -> Option<Cut> {
        let cut = self.cut.filter(|cut| cut.after == 0);
        if let Some(cut) = &mut self.cut {
            cut.after = cut.after.saturating_sub(1);
        }
        self.powered = cut.is_none();
        self.history.push(operation);
        cut
    }

    /// True if operations change nothing.
    pub(crate) const fn is_inert(&self) -> bool {
        self.inert
    }

    /// Returns an error after a power cut.
    pub(crate) const fn check_power(&self) -> Result<(), Error> {
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

    /// The bits of `list` that belong to the word at `address`.
    fn bits(list: &[Bits], address: usize) -> u32 {
        list.iter().filter(|bits| bits.address == address).fold(0, |mask, bits| mask | bits.mask)
    }

    pub(crate) fn program(&mut self, address: usize, new: &[u8]) -> Result<(), Error> {
        self.check_power()?;
        if self.half_erased >> (address / SECTOR) & 1 == 1 {
            return Err(Error::HalfErased);
        }
        self.request(address, new)?;
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

    /// Records the requested value of a word, or refuses a different second value.
    fn request(&mut self, address: usize, new: &[u8]) -> Result<(), Error> {
        let requested = self.requested.get_mut(address..address + WORD).unwrap_or_default();
        let is_blank = |word: &[u8]| word.iter().all(|byte| *byte == 0xFF);
        if is_blank(requested) {
            requested.copy_from_slice(new);
        } else if requested == new {
            self.reprogrammed += 1;
        } else {
            return Err(Error::ProgrammedTwice);
        }
        Ok(())
    }

    pub(crate) fn erase_sector(&mut self, sector: usize) -> Result<(), Error> {
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
                self.requested.get_mut(range.clone()).unwrap_or_default().fill(0xFF);
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

/// The word as a little-endian number. Missing bytes are 0.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}
