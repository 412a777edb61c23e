//! What a power cut in the middle of an operation leaves behind, one word at a time.
//!
//! A *marginal* bit is a cell that was charged half way: it reads 0 or 1 from one start to the next.

use crate::random::Random;

/// The bits of one word, as an operation that was cut leaves them. What is in neither set is as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Torn {
    /// Read 0 from now on.
    pub(crate) cleared: u32,
    /// Read 1 from now on.
    pub(crate) set: u32,
    /// May read either way.
    pub(crate) marginal: u32,
}

/// How the programming of a word is cut. It takes ones to zeros; a one that was to stay stays a one, but for
/// the last kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgramTear {
    /// Before it began.
    Nothing,
    /// When it was complete, and before anybody was told.
    All,
    /// After this many bytes.
    Bytes(u32),
    /// Any of the bits are programmed, the others not.
    RandomBits,
    /// One bit is programmed.
    OneBit,
    /// One bit is not.
    AllButOne,
    /// Every bit that was to be programmed is marginal.
    MarginalWord,
    /// Complete, but for one marginal bit.
    OneMarginal,
    /// Complete, but for two marginal bits: more than a single error correction puts right.
    TwoMarginal,
    /// At the very beginning: one bit is marginal, the others untouched. Half the time nothing shows.
    FaintOne,
    /// At the very beginning, with two marginal bits.
    FaintTwo,
    /// At the very beginning, and two bits are marginal that were to stay ones. No NOR cell is known to do
    /// so, but the contract of `NorFlash` allows it; not in [`ProgramTear::ALL`].
    Disturbed,
}

impl ProgramTear {
    /// What NOR cells do.
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

    /// What becomes of a word in which `bits` were to be cleared.
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

/// How the erase of a sector is cut. An erase takes zeros to ones, and marginal bits first: one that was
/// begun leaves none of those that were there before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EraseTear {
    /// Before it began.
    Nothing,
    /// When it was complete, and before anybody was told.
    All,
    /// Every bit is whatever it may be.
    Noise,
    /// Any of the zeros are ones now.
    RandomBits,
    /// From the beginning up to some word it is blank.
    Prefix,
    /// From some word on it is blank.
    Suffix,
    /// Blank at both ends, and noise in between.
    Edges,
    /// All zeros: chips program a sector before they erase it.
    AllZero,
    /// Zeros up to some word, for the same reason.
    ZeroPrefix,
    /// One zero in a hundred is left.
    MostlyBlank,
    /// It looks blank, but one bit in a hundred is marginal.
    MarginalBlank,
    /// At the very beginning: one zero in five hundred is marginal.
    Faint,
}

impl EraseTear {
    /// All of them.
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

    /// What becomes of the words of a sector, in ascending order.
    pub(crate) fn tear(self, words: &[u32], random: &mut Random) -> Vec<Torn> {
        let count = words.len() as u64;
        let first = random.below(count);
        let blank_from = first + random.below(count - first);
        let places = (0..count).zip(words);
        places.map(|(place, word)| self.tear_word(*word, place < first, place < blank_from, random)).collect()
    }

    /// What becomes of a `word`, which is in the first part of the sector or not, and in the first two parts
    /// or not.
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

/// A word in which one bit in `many` is a one.
fn rare(many: u64, random: &mut Random) -> u32 {
    (0..32).filter(|_| random.below(many) == 0).fold(0, |word, bit| word | 1 << bit)
}
