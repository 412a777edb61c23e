//! The project's chores: the only scripts there are. `cargo xtask help` lists them.
//!
//! Knows how the project is checked, measured and documented; knows nothing of how an arm works.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

mod bench;
mod budget;
mod count;
mod coverage;
mod crate_graph;
mod decisions;
mod deny;
mod drawings;
mod elf;
mod emulate;
mod footprint;
mod fuzz;
mod generated;
mod install;
mod jump_table;
mod modules;
mod no_panic;
mod registers_md;
mod run;
mod sag;
mod size;
mod stack;
mod start_up;
mod steps;
mod test;
mod thumb_decode;
mod times;
mod torture;
mod trials;
mod workspace;
mod worlds;

use run::Outcome;

/// The project's chores.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Subcommand)]
enum Chore {
    /// Install what the tests need, then run every check and every test; each step says how long it took.
    Test(test::Options),
    /// Write the generated documents: docs/registers.md, the table of tests in docs/protocol.md, the picture of the
    /// crates in docs/design.md, and docs/circuits.
    Docs {
        /// Change nothing; fail if a document is stale
        #[arg(long)]
        check: bool,
    },
    /// Try to break the arm: worlds in which everything goes wrong, a disturbed line, power cuts, a fuzzer.
    ///
    /// Prints one table: what was tried, how many, what went wrong, from which seed. The same seed tries the
    /// same worlds; how many, the time decides.
    Torture(torture::Options),
    /// Feed six parts of it with inputs that a fuzzer makes up (needs a C++ compiler).
    Fuzz(fuzz::Options),
    /// Check licences, versions and sources of all dependencies, and the advisories where they can be had.
    Deny,
    /// Fail if files of a crate depend on each other in a cycle.
    Modules,
    /// Link the cores for the chip and fail if a panic can be reached.
    NoPanic,
    /// Print what the cores and the image cost on the chip, in bytes, and hold it against the budgets.
    Size {
        /// Print where the bytes are, by section and by file of source, and no more
        #[arg(long)]
        by_file: bool,
        #[command(flatten)]
        accept: Accept,
    },
    /// Check what the image for the arm does to the chip's registers at start, by the emulator's log of them.
    StartUp,
    /// Count instructions in the emulator, and hold them against the budgets.
    Count(Accept),
    /// Show what the tests of the cores run through, and fail if it is less than it was.
    Coverage,
    /// Compare the parse-and-answer path with its peers: Modbus, postcard with COBS, MAVLink.
    Bench(bench::Options),
    /// Run the image for the arm in an emulator, simulated servos on its bus, and print the port it is on.
    ///
    /// SIGHUP (`kill -HUP`) switches the arm off and on, SIGUSR2 restarts the chip alone, Ctrl-C ends it. The
    /// emulator keeps no settings: its flash ignores what it is told, and the status block says so (fault bit 0).
    Emulate(emulate::Options),
    /// Measure how far the arm sags in the emulator over restarts, a panic, noise and a silent servo.
    Sag,
}

/// What becomes of the figures.
#[derive(clap::Args)]
struct Accept {
    /// Commit the figures as they are instead of comparing them
    #[arg(long)]
    accept: bool,
}

fn main() -> ExitCode {
    match carry_out(&Arguments::parse().chore) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

/// A generated document.
struct Document {
    write: fn() -> Outcome,
    check: fn() -> Outcome,
}

const DOCUMENTS: [Document; 4] = [
    Document { write: registers_md::write, check: registers_md::check },
    Document { write: decisions::write, check: decisions::check },
    Document { write: crate_graph::write, check: crate_graph::check },
    Document { write: drawings::write, check: drawings::check },
];

fn carry_out(chore: &Chore) -> Outcome {
    match chore {
        Chore::Test(options) => test::run_steps(options),
        Chore::Docs { check: true } => DOCUMENTS.iter().try_for_each(|document| (document.check)()),
        Chore::Docs { check: false } => DOCUMENTS.iter().try_for_each(|document| (document.write)()),
        Chore::Modules => modules::check(),
        Chore::Torture(options) => torture::run(options),
        Chore::Fuzz(options) => fuzz::check(options),
        Chore::Deny => deny::check(),
        Chore::NoPanic => no_panic::check(),
        Chore::Size { by_file: true, .. } => size::print(),
        Chore::Size { accept, .. } => footprint::check(accept.accept),
        Chore::StartUp => start_up::check(),
        Chore::Count(Accept { accept }) => count::check(*accept),
        Chore::Coverage => coverage::check(),
        Chore::Emulate(options) => emulate::run(options),
        Chore::Sag => sag::measure(),
        Chore::Bench(options) => bench::run(options),
    }
}
