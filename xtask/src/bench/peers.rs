//! The parse-and-answer path beside its peers, on this machine by the clock and on the chip by
//! instructions and bytes.

use crate::count::{self, Told};
use crate::run::{Linked, Outcome, build_footprint, cargo};
use crate::{emulate, footprint};

/// Those compared, and the program in which each of them counts itself. Ours comes first.
const CONTESTANTS: &[(&str, &str)] = &[
    ("protocol-core", "count_ours"),
    ("modbus-core", "count_modbus_core"),
    ("rmodbus", "count_rmodbus"),
    ("postcard+cobs", "count_postcard"),
    ("mavlink", "count_mavlink"),
];

/// Prints both comparisons.
pub(crate) fn compare() -> Outcome {
    emulate::need_qemu()?;
    cargo("run --quiet --release --package bench")?;
    for &(profile, words) in count::PROFILES {
        build_footprint(profile)?;
        println!("\nCortex-M4, {words}: instructions of a request, counted in the emulator, and bytes");
        print_chip(profile)?;
    }
    Ok(())
}

fn print_chip(profile: &'static str) -> Outcome {
    let all = CONTESTANTS.iter().map(|&(_, name)| costs(&Linked { name, profile }));
    let all: Vec<Costs> = all.collect::<Outcome<_>>()?;
    let names: String = CONTESTANTS.iter().map(|(name, _)| format!("{name:>14}")).collect();
    println!("{:32}{names}{:>13}", "", "ours / best");
    for (what, ours) in all.first().into_iter().flatten() {
        let cost = |costs: &Costs| costs.iter().find(|(name, _)| name == what).and_then(|&(_, cost)| cost);
        let cells: String = all.iter().map(|costs| format!("{:>14}", or_dash(cost(costs)))).collect();
        let best = all.iter().skip(1).filter_map(cost).min();
        let ratio = ours.zip(best).map(|(ours, best)| format!("{:.2}", ours as f64 / best as f64));
        println!("{what:32}{cells}{:>13}", or_dash(ratio));
    }
    Ok(())
}

/// What each thing costs, by its name; `None` where it has no bound that is known.
type Costs = Vec<(String, Option<u64>)>;

fn costs(program: &Linked) -> Outcome<Costs> {
    let counted = count::of(program)?;
    let mut costs: Costs = counted.into_iter().map(|(name, count): Told| (name, Some(count))).collect();
    // Peers may call through pointers, and panic: how deep their stack gets cannot be told then.
    costs.push(("stack, bytes".to_owned(), footprint::stack_of_path(program).ok()));
    costs.push(("flash, bytes".to_owned(), Some(footprint::flash_of_path(program)?)));
    Ok(costs)
}

fn or_dash(figure: Option<impl ToString>) -> String {
    figure.map_or_else(|| "-".to_owned(), |figure| figure.to_string())
}
