//! The state of each word after a power cut during an operation.
//!
//! A *marginal* bit is a partly charged cell: it may read 0 after one power-up and 1 after the next.

use crate::random::Random;

/// The bits of a word that an operation changes. All other bits keep their value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Torn {
    /// Bits that read 0 now.
    pub(crate) cleared: u32,
    /// Bits that read 1 now.
    pub(crate) set: u32,
    pub(crate) marginal: u32,
}

/// How a power cut interrupts the programming of a word. Programming clears bits. Only [`ProgramTear::Disturbed`] affects bits
/// that are not to be cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgramTear {
    /// The cut comes before the operation: nothing changes.
    Nothing,
    /// The operation is complete, but it is not reported.
    All,
    /// Only this many bytes are programmed, from the lowest address on.
    Bytes(u32),
    /// A random part of the bits is programmed.
    RandomBits,
    /// Only one random bit is programmed.
    OneBit,
    /// All bits but one are programmed.
    AllButOne,
    /// All bits to be programmed are marginal.
    MarginalWord,
    /// All bits are programmed but one, which is marginal.
    OneMarginal,
    /// All bits are programmed but two, which are marginal. A code that corrects single errors may fail to repair this.
    TwoMarginal,
    /// One bit is marginal, the others are unchanged. Half of the power-ups show the old word.
    FaintOne,
    /// Two bits are marginal, the others are unchanged.
    FaintTwo,
    /// Two bits that are not to be cleared are marginal, the others are unchanged. No NOR flash is known to do this, but the
    /// contract of `NorFlash` allows it. Not in [`ProgramTear::ALL`].
    Disturbed,
}

impl ProgramTear {
    /// The tears of real NOR flash.
    pub const ALL: [Self; 13] = [
        Self::Nothing,
        Self::All,
        Self::Bytes(1),
        Self::Bytes(2),
        Self::Bytes(3),
        Self::RandomBits,
        Self::OneBit,
        Self::AllButOne,
        Self::MarginalWord,
        Self::OneMarginal,
        Self::TwoMarginal,
        Self::FaintOne,
        Self::FaintTwo,
    ];

    /// The result for a word in which `bits` are to be cleared.
    pub(crate) fn tear(self, bits: u32, random: &mut Random) -> Torn {
        let one = random.one_of(bits);
        let two = one | random.one_of(bits & !one);
        let cleared = |cleared| Torn { cleared, ..Torn::default() };
        match self {
            Self::Nothing => Torn::default(),
            Self::All => cleared(bits),
            Self::Bytes(count) => cleared(bits & !u32::MAX.checked_shl(8 * count).unwrap_or(0)),
            Self::RandomBits => cleared(bits & random.word()),
            Self::OneBit => cleared(one),
            Self::AllButOne => cleared(bits & !one),
            Self::MarginalWord => Torn { marginal: bits, ..Torn::default() },
            Self::OneMarginal => Torn { marginal: one, ..cleared(bits & !one) },
            Self::TwoMarginal => Torn { marginal: two, ..cleared(bits & !two) },
            Self::FaintOne => Torn { marginal: one, ..Torn::default() },
            Self::FaintTwo => Torn { marginal: two, ..Torn::default() },
            Self::Disturbed => {
                let one = random.one_of(!bits);
                Torn { marginal: one | random.one_of(!bits & !one), ..Torn::default() }
            }
        }
    }
}

/// How a power cut interrupts the erase of a sector. An erase sets bits. An erase that has begun removes all earlier marginal
/// bits of the sector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EraseTear {
    /// The cut comes before the operation: nothing changes.
    Nothing,
    /// The operation is complete, but it is not reported.
    All,
    /// All bits are random.
    Noise,
    /// A random part of the zeros is set.
    RandomBits,
    /// The first part of the sector is blank, the rest is unchanged.
    Prefix,
    /// The last part of the sector is blank, the rest is unchanged.
    Suffix,
    /// Both ends are blank, the middle is random.
    Edges,
    /// All bits are 0, because chips program a sector before they erase it.
    AllZero,
    /// All bits of the first part are 0, for the same reason. The rest is unchanged.
    ZeroPrefix,
    /// The sector is blank, but one bit in a hundred is unchanged.
    MostlyBlank,
    /// The sector is blank, but one bit in a hundred is marginal.
    MarginalBlank,
    /// One zero in five hundred is marginal, the rest is unchanged.
    Faint,
}

impl EraseTear {
    /// All tears, in the order of their declaration.
    pub const ALL: [Self; 12] = [
        Self::Nothing,
        Self::All,
        Self::Noise,
        Self::RandomBits,
        Self::Prefix,
        Self::Suffix,
        Self::Edges,
        Self::AllZero,
        Self::ZeroPrefix,
        Self::MostlyBlank,
        Self::MarginalBlank,
        Self::Faint,
    ];

    /// The result for each word of a sector, in ascending order.
    pub(crate) fn tear(self, words: &[u32], random: &mut Random) -> Vec<Torn> {
        let count = words.len() as u64;
        let first = random.below(count);
        let blank_from = first + random.below(count - first);
        let places = (0..count).zip(words);
        places.map(|(place, word)| self.tear_word(*word, place < first, place < blank_from, random)).collect()
    }

    /// The result for `word`. The flags tell whether it lies in the first part of the sector, and in the first two of three
    /// parts.
    fn tear_word(self, word: u32, in_first: bool, in_first_two: bool, random: &mut Random) -> Torn {
        let set = |set| Torn { set, ..Torn::default() };
        let zero = Torn { cleared: u32::MAX, ..Torn::default() };
        match self {
            Self::Nothing => Torn::default(),
            Self::All => set(u32::MAX),
            Self::Noise => noise(random),
            Self::RandomBits => set(random.word()),
            Self::Prefix => set(if in_first { u32::MAX } else { 0 }),
            Self::Suffix => set(if in_first { 0 } else { u32::MAX }),
            Self::Edges if in_first || !in_first_two => set(u32::MAX),
            Self::Edges => noise(random),
            Self::AllZero => zero,
            Self::ZeroPrefix if in_first => zero,
            Self::ZeroPrefix => Torn::default(),
            Self::MostlyBlank => set(!rare(100, random)),
            Self::MarginalBlank => Torn { marginal: rare(100, random), ..set(u32::MAX) },
            Self::Faint => Torn { marginal: rare(500, random) & !word, ..Torn::default() },
        }
    }
}

fn noise(random: &mut Random) -> Torn {
    let set = random.word();
    Torn { set, cleared: !set, marginal: 0 }
}

/// A word in which each bit is set with a probability of 1 in `many`.
fn rare(many: u64, random: &mut Random) -> u32 {
    (0..32).filter(|_| random.below(many) == 0).fold(0, |word, bit| word | 1 << bit)
}
