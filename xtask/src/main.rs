//! The tasks of the project: checks, measurements and generated documents. `cargo xtask help` lists them.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

mod blockly;
mod budget;
mod count;
mod coverage;
mod crate_graph;
mod decisions;
mod deny;
mod dist;
mod docs;
mod footprint;
mod fuzz;
mod generated;
mod install;
mod lerobot;
mod modules;
mod mujoco;
mod no_panic;
mod peers;
mod python;
mod registers_md;
mod replays;
mod ros;
mod ros_model;
mod run;
mod size;
mod steps;
mod system_tests;
mod test;
mod times;
mod torture;
mod trials;
mod venv;
mod web;
mod workspace;

use run::TaskResult;

/// Checks, measurements and generated documents of the project
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct XtaskArgs {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Install what the tests need, then run all checks and tests, and print the time of each step
    Test(test::TestArgs),
    /// Write the generated documents: docs/registers.md, the table of tests in docs/protocol.md, the crates in docs/design.md, and the
    /// model in the ROS packages
    Docs {
        /// Change nothing; fail if a document is out of date
        #[arg(long)]
        check: bool,
    },
    /// Search for faults: simulated worlds, a disturbed line, power cuts, fuzzing.
    ///
    /// Prints one table: trials, their number, failures and seeds. A seed reproduces its worlds. The time determines how
    /// many run.
    Torture(torture::TortureArgs),
    /// Record random sessions with a simulated arm natively and in a WebAssembly module, compare them, and replay them
    Replays,
    /// Fuzz six parts of the arm and the library (needs a C++ compiler)
    Fuzz(fuzz::FuzzArgs),
    /// Check licences, versions and sources of all dependencies, and the advisories if they can be downloaded
    Deny,
    /// Make everything that a release consists of: archives, packages, wheels, the image, the page, and their sums
    Dist(dist::DistArgs),
    /// Fail if files of a crate depend on each other in a cycle
    Modules,
    /// Install MuJoCo from PyPI, and compare its forward kinematics of the arm's model with ours (needs Python)
    Mujoco,
    /// Build the Python package and test it with each Python on PATH from 3.10 on (installs packages from PyPI)
    Python,
    /// Install ROS 2 from PyPI, and test the packages in the folder ros with it (needs Python 3.10 to 3.13)
    Ros,
    /// Build the page in web/dist, and fail if it is too large
    Web,
    /// Build the page, then run `sevenbot view` with these arguments
    View {
        /// Arguments of `sevenbot view`, or options before the command
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Link the cores for the chip and fail if a panic is reachable
    NoPanic,
    /// Print the size of the cores and the image on the chip, and compare it with the budgets
    Size {
        /// Print the sizes by section and source file only
        #[arg(long)]
        by_file: bool,
        #[command(flatten)]
        accept: Accept,
    },
    /// Check the accesses of the image to the chip's registers at start, in the log of the emulator
    StartUp,
    /// Count instructions in the emulator, and compare them with the budgets
    Count(Accept),
    /// Print the coverage of the cores, and fail below its limits
    Coverage,
    /// Compare the parse-and-reply path with its peers: Modbus, postcard with COBS, MAVLink
    Bench(peers::BenchArgs),
    /// Run the image for the arm in an emulator with simulated servos, and print its port.
    ///
    /// SIGHUP (`kill -HUP`) switches the arm off and on, SIGUSR2 restarts the chip alone, Ctrl-C ends it. The emulator keeps no
    /// settings: its flash does not change, and the status block reports fault bit 0.
    Emulate(emulator::EmulateArgs),
    /// Measure how far the emulated arm sags during restarts, a panic, noise and a silent servo
    Sag,
    /// Measure how the emulated arm behaves at walls, after emergency stops, and with a thing in its gripper (seven minutes)
    Obstacles,
}

/// What to do with the figures.
#[derive(clap::Args)]
struct Accept {
    /// Commit the figures instead of comparing them
    #[arg(long)]
    accept: bool,
}

fn main() -> ExitCode {
    match run_task(&XtaskArgs::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn run_task(task: &Task) -> TaskResult {
    match task {
        Task::Test(options) => test::run_steps(options),
        Task::Docs { check: true } => docs::check(),
        Task::Docs { check: false } => docs::write(),
        Task::Dist(options) => dist::run(options),
        Task::Modules => modules::check(),
        Task::Torture(options) => torture::run(options),
        Task::Replays => replays::long(),
        Task::Fuzz(options) => fuzz::check(options),
        Task::Deny => deny::check(),
        Task::Mujoco => mujoco::check(),
        Task::Python => python::check(),
        Task::Ros => ros::check(),
        Task::Web => web::build(),
        Task::View { arguments } => web::view(arguments),
        Task::NoPanic => no_panic::check(),
        Task::Size { by_file: true, .. } => size::print(),
        Task::Size { accept, .. } => footprint::check(accept.accept),
        Task::StartUp => run::start_up(),
        Task::Count(Accept { accept }) => count::check(*accept),
        Task::Coverage => coverage::check(),
        Task::Emulate(options) => emulate(options),
        Task::Sag => run::experiment("sag"),
        Task::Obstacles => run::experiment("obstacles"),
        Task::Bench(options) => peers::run(options),
    }
}

/// Builds the image and the simulator unless the options forbid it, and runs them.
fn emulate(options: &emulator::EmulateArgs) -> TaskResult {
    if !options.no_build {
        emulator::need_qemu()?;
        run::build_image()?;
        run::build_host_sim()?;
    }
    emulator::run(options)
}
