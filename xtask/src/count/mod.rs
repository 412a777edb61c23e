//! `cargo xtask count`: how many instructions things take on the chip, counted in the emulator.
//!
//! Instructions, not cycles: flash, branches and divisions take their time on silicon, and nobody has measured that
//! yet. But they are exact and the same in every run, so the smallest step for the worse is seen.

mod cores;
mod image;
mod machine;
mod trace;

pub(crate) use cores::Told;
pub(crate) use machine::frame;

use crate::budget::{self, Figure};
use crate::emulate;
use crate::run::{FAST, Linked, Outcome, SMALL, build_footprint, build_image, cargo};

/// Programs that count themselves and have budgets.
const OURS: &[&str] = &["count_ours", "count_arm"];
/// What each program is built for.
pub(crate) const PROFILES: &[(&str, &str)] = &[(SMALL, "opt-level s"), (FAST, "opt-level 3")];

/// Counts, prints, and holds the counts against their budgets.
pub(crate) fn check(accept: bool) -> Outcome {
    emulate::need_qemu()?;
    build_image()?;
    cargo("build --quiet --package host-sim")?;
    let mut figures = image::figures()?;
    for &(profile, words) in PROFILES {
        build_footprint(profile)?;
        for &name in OURS {
            figures.extend(told(&Linked { name, profile }, words)?);
        }
    }
    budget::hold("count", &figures, accept)
}

/// What a program has to tell if it did the work that is counted.
const PROOFS: &[(&str, u64)] =
    &[("requests carried out", 6), ("joints moving", 127), ("servos missing", 0), ("bytes of the reply", 14)];

/// What a program tells, if it did its work.
pub(crate) fn of(program: &Linked) -> Outcome<Vec<Told>> {
    proven(program, cores::figures(program)?)
}

/// What a program of ours tells, twice the same.
fn told(program: &Linked, words: &str) -> Outcome<Vec<Figure>> {
    let figures = cores::figures(program)?;
    if cores::figures(program)? != figures {
        Err(format!("{} did not count the same twice", program.name))?;
    }
    let figures = proven(program, figures)?.into_iter();
    Ok(figures.map(|(name, count)| Figure::new(format!("cores: {name}, {words}"), count)).collect())
}

/// The counts, less the proofs that the work was done.
fn proven(program: &Linked, told: Vec<Told>) -> Outcome<Vec<Told>> {
    let (proofs, counts): (Vec<_>, Vec<_>) =
        told.into_iter().partition(|(name, _)| PROOFS.iter().any(|(proof, _)| proof == name));
    let is_right = |(name, count): &Told| PROOFS.contains(&(name, *count));
    if proofs.is_empty() || !proofs.iter().all(is_right) {
        Err(format!("{} did not do its work: {proofs:?}", program.name))?;
    }
    Ok(counts)
}
