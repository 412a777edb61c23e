//! The settings' journal through power cycles of any kind, cut at any step in any way (D19), on the strict
//! flash: what must hold is what the journal's own tests check in every power cycle.

use crate::shared::journal_world::World;
use arbitrary::Arbitrary;
use flash_model::{Cut, EraseTear, ProgramTear};

/// What is tried.
#[derive(Arbitrary, Debug)]
pub struct Input {
    size: Size,
    cycles: Vec<Cycle>,
}

/// Of a sector. Small ones are full sooner.
#[derive(Arbitrary, Debug)]
enum Size {
    Bytes512,
    Bytes1024,
    Bytes2048,
}

#[derive(Arbitrary, Debug)]
struct Cycle {
    saves: u8,
    cut: Option<PowerCut>,
    /// Decides how half programmed cells read at the start.
    reads_as: u8,
}

#[derive(Arbitrary, Debug)]
struct PowerCut {
    after: u8,
    program: u8,
    erase: u8,
    seed: u8,
}

impl From<&PowerCut> for Cut {
    fn from(cut: &PowerCut) -> Self {
        Self {
            after: cut.after.into(),
            program: ProgramTear::ALL[usize::from(cut.program) % ProgramTear::ALL.len()],
            erase: EraseTear::ALL[usize::from(cut.erase) % EraseTear::ALL.len()],
            seed: cut.seed.into(),
        }
    }
}

/// Tries it. Panics where something does not hold.
pub fn run(input: &Input) {
    match input.size {
        Size::Bytes512 => live::<512>(&input.cycles),
        Size::Bytes1024 => live::<1_024>(&input.cycles),
        Size::Bytes2048 => live::<2_048>(&input.cycles),
    }
}

fn live<const SECTOR: usize>(cycles: &[Cycle]) {
    let mut world = World::<SECTOR>::new();
    for Cycle { saves, cut, reads_as } in cycles {
        world.seed ^= u64::from(*reads_as);
        world.cycle(usize::from(saves % 32), cut.as_ref().map(Cut::from));
    }
    world.settle();
}
