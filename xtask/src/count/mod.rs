//! `cargo xtask count`: counts instructions on the emulated chip.
//!
//! Instructions are not cycles: flash wait states, branches and divisions take time on the chip. But most counts are the
//! same in every run, so they show every increase.

mod cores;
mod direction;
mod image;
mod load;
mod masked;

pub(crate) use cores::NamedCount;

use crate::budget::{self, Figure};
use crate::run::{ChipProgram, FAST, SMALL, TaskResult, build_footprint, build_host_sim, build_image};

/// Programs with budgets that count their own instructions.
const OURS: &[&str] = &["count_ours", "count_arm", "count_kinematics"];
/// The profiles and their descriptions.
pub(crate) const PROFILES: &[(&str, &str)] = &[(SMALL, "opt-level s"), (FAST, "opt-level 3")];

/// Counts, prints, and compares the counts with their budgets.
pub(crate) fn check(accept: bool) -> TaskResult {
    emulator::need_qemu()?;
    build_image()?;
    build_host_sim()?;
    let mut figures = image::figures()?;
    figures.push(load::figure()?);
    for &(profile, words) in PROFILES {
        build_footprint(profile)?;
        for &name in OURS {
            figures.extend(measured(&ChipProgram { name, profile }, words)?);
        }
    }
    budget::check("count", &figures, accept)
}

/// Values that prove that a program did the counted work.
const EXPECTED: &[(&str, u64)] = &[
    ("requests carried out", 6),
    ("joints moving", 127),
    ("servos missing", 0),
    ("bytes of the reply", 14),
    ("kinematics give the bits of the host", 1),
];

/// Runs a program and returns its counts. Fails if the program did not do its work.
pub(crate) fn of(program: &ChipProgram) -> TaskResult<Vec<NamedCount>> {
    checked(program, cores::figures(program)?)
}

/// The counts of one of our programs, checked by a second run.
fn measured(program: &ChipProgram, words: &str) -> TaskResult<Vec<Figure>> {
    let figures = cores::figures(program)?;
    if cores::figures(program)? != figures {
        Err(format!("the second run of {} has other counts", program.name))?;
    }
    let figures = checked(program, figures)?.into_iter();
    Ok(figures.map(|(name, count)| Figure::new(format!("cores: {name}, {words}"), count)).collect())
}

/// The counts without the values that prove the work.
fn checked(program: &ChipProgram, measured: Vec<NamedCount>) -> TaskResult<Vec<NamedCount>> {
    let (results, counts): (Vec<_>, Vec<_>) =
        measured.into_iter().partition(|(name, _)| EXPECTED.iter().any(|(proof, _)| proof == name));
    let is_right = |(name, count): &NamedCount| EXPECTED.contains(&(name, *count));
    if results.is_empty() || !results.iter().all(is_right) {
        Err(format!("{} did not do its work: {results:?}", program.name))?;
    }
    Ok(counts)
}
