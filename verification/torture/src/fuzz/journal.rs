//! The journal of the settings with any power cuts (D19), on the strict flash model. The journal's own tests define
//! the invariants.

use crate::shared::journal_world::World;
use arbitrary::Arbitrary;
use flash_model::{Cut, EraseTear, ProgramTear};

/// The size of the sectors, and what happens in each power cycle.
#[derive(Arbitrary, Debug)]
pub struct Input {
    size: SectorSize,
    cycles: Vec<PowerCycle>,
}

/// The size of a sector. A small one is full sooner.
#[derive(Arbitrary, Debug)]
enum SectorSize {
    Bytes512,
    Bytes1024,
    Bytes2048,
}

#[derive(Arbitrary, Debug)]
struct PowerCycle {
    saves: u8,
    cut: Option<CutInput>,
    /// Decides how marginal bits read at the start.
    reads_as: u8,
}

#[derive(Arbitrary, Debug)]
struct CutInput {
    after: u8,
    program: u8,
    erase: u8,
    seed: u8,
}

impl From<&CutInput> for Cut {
    fn from(cut: &CutInput) -> Self {
        Self {
            after: cut.after.into(),
            program: ProgramTear::ALL[usize::from(cut.program) % ProgramTear::ALL.len()],
            erase: EraseTear::ALL[usize::from(cut.erase) % EraseTear::ALL.len()],
            seed: cut.seed.into(),
        }
    }
}

/// Runs the power cycles. Panics if an invariant is violated.
pub fn run(input: &Input) {
    match input.size {
        SectorSize::Bytes512 => run_cycles::<512>(&input.cycles),
        SectorSize::Bytes1024 => run_cycles::<1_024>(&input.cycles),
        SectorSize::Bytes2048 => run_cycles::<2_048>(&input.cycles),
    }
}

fn run_cycles<const SECTOR: usize>(cycles: &[PowerCycle]) {
    let mut world = World::<SECTOR>::new();
    for PowerCycle { saves, cut, reads_as } in cycles {
        world.seed ^= u64::from(*reads_as);
        world.cycle(usize::from(saves % 32), cut.as_ref().map(Cut::from));
    }
    world.settle();
}
