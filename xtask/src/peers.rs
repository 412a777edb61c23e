//! `cargo xtask bench`: compares the parse-and-reply path with its peers: time on this machine; instructions and bytes on the
//! chip. Other measurements are programs of `benchmarks/bench`. These measurements have no budgets, unlike `count` and `size`.

use crate::count::{self, NamedCount};
use crate::footprint;
use crate::run::{ChipProgram, TaskResult, build_footprint, cargo};
use torture::text_table::Column::{Left, Right};
use torture::text_table::TextTable;

/// The compared servers, each with the program that counts its instructions. Ours comes first.
const SERVERS: &[(&str, &str)] = &[
    ("protocol-core", "count_ours"),
    ("modbus-core", "count_modbus_core"),
    ("rmodbus", "count_rmodbus"),
    ("postcard+cobs", "count_postcard"),
    ("mavlink", "count_mavlink"),
];

/// Arguments of `cargo xtask bench`.
#[derive(clap::Args)]
pub(crate) struct BenchArgs {
    /// Measure the host programs instead: their size, start and round trip, and the load of 1, 10, 100 and 1000 simulated
    /// arms in one process
    #[arg(long)]
    programs: bool,
    /// Measure simulated arms in virtual time instead: 1, 10, 100 and 1000 of them, on one and two threads
    #[arg(long, conflicts_with = "programs")]
    simulation: bool,
    /// Print how evenly and how late set-points follow streams of points with jitter, losses and pauses, beside other methods
    #[arg(long, conflicts_with_all = ["programs", "simulation"])]
    streams: bool,
}

pub(crate) fn run(args: &BenchArgs) -> TaskResult {
    let bench = |program: &str| cargo(&format!("run --quiet --release --package bench --bin {program}"));
    match args {
        BenchArgs { programs: true, .. } => {
            cargo("build --quiet --release --package host-sim --package sevenbot-cli")?;
            bench("programs")
        }
        BenchArgs { simulation: true, .. } => bench("simulation"),
        BenchArgs { streams: true, .. } => bench("streams"),
        _ => compare(),
    }
}

fn compare() -> TaskResult {
    emulator::need_qemu()?;
    cargo("run --quiet --release --package bench")?;
    for &(profile, words) in count::PROFILES {
        build_footprint(profile)?;
        println!("\nCortex-M4, {words}: instructions of a request, counted in the emulator, and bytes");
        print_chip(profile)?;
    }
    Ok(())
}

fn print_chip(profile: &'static str) -> TaskResult {
    let all = SERVERS.iter().map(|&(_, name)| costs(&ChipProgram { name, profile }));
    let all: Vec<Costs> = all.collect::<TaskResult<_>>()?;
    let names = SERVERS.iter().map(|&(name, _)| Right(name));
    let mut table = TextTable::new([Left("")].into_iter().chain(names).chain([Right("ours / best")]));
    for (what, ours) in all.first().into_iter().flatten() {
        let cost = |costs: &Costs| costs.iter().find(|(name, _)| name == what).and_then(|&(_, cost)| cost);
        let best = all.iter().skip(1).filter_map(cost).min();
        let ratio = ours.zip(best).map(|(ours, best)| format!("{:.2}", ours as f64 / best as f64));
        let cells = all.iter().map(|costs| or_dash(cost(costs)));
        table.add([what.clone()].into_iter().chain(cells).chain([or_dash(ratio)]));
    }
    print!("{table}");
    Ok(())
}

/// The costs by name; `None` for a cost without a known bound.
type Costs = Vec<(String, Option<u64>)>;

fn costs(program: &ChipProgram) -> TaskResult<Costs> {
    let counted = count::of(program)?;
    let mut costs: Costs = counted.into_iter().map(|(name, count): NamedCount| (name, Some(count))).collect();
    // Calls through pointers and panics leave a peer's stack without a known bound.
    costs.push(("stack, bytes".to_owned(), footprint::stack_of_path(program).ok()));
    costs.push(("flash, bytes".to_owned(), Some(footprint::flash_of_path(program)?)));
    Ok(costs)
}

fn or_dash(figure: Option<impl ToString>) -> String {
    figure.map_or_else(|| "-".to_owned(), |figure| figure.to_string())
}
