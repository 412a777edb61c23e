//! Each command of the table under each fault of the table: no command reports success unless the arm did what was asked. A
//! second test checks what the monitor shows when the arm cannot obey a key.
//!
//! This is a test program of its own, because it starts 24 arms at a time, and because what a command notices of a short
//! fault depends on how busy the machine is.
//!
//! The snapshot holds the exit status and the first message of each command under each fault. A command succeeds only where the
//! arm did what was asked, or where the command had only to print something. docs/reliability.md has the exit statuses.
//!
//! `CELL="stop / silent" cargo test -p system-tests --test faults -- --nocapture` shows all that these cells say.

mod fault_table;

use std::env;
use std::fmt::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use fault_table::{COMMANDS, Cell, Command, FAULTS, Fault, run};
use serde_json::json;
use system_tests::control::Control;
use system_tests::programs::sevenbot;
use system_tests::simulator::Simulator;
use system_tests::terminal::Terminal;

/// Cells that run at the same time. Each one spends most of its time waiting.
const THREADS: usize = 24;
/// How often rows that differ from the document are run again.
const ROUNDS: usize = 2;
/// The document that has a short form of the table.
const DOCUMENT: &str = include_str!("../../../docs/reliability.md");

#[test]
fn no_command_reports_success_under_a_fault_that_prevents_it() {
    let only = env::var("CELL").unwrap_or_default();
    let mut cells = run_cells(|name| name.contains(&only));
    if !only.is_empty() {
        cells.iter().for_each(|(name, cell)| {
            println!("=== {name}: {:?} {:?}\n{}", cell.status, cell.is_done, cell.text);
        });
        return;
    }
    assert_no_false_success(&cells);
    (0..ROUNDS).for_each(|_| run_again(&mut cells));
    insta::assert_snapshot!(table(&cells));
    let short = short_table(&cells);
    assert!(DOCUMENT.contains(&short), "docs/reliability.md has another table than this one:\n{short}");
}

fn assert_no_false_success(cells: &[(String, Cell)]) {
    let wrong: Vec<_> =
        cells.iter().filter(|(_, cell)| cell.is_wrong()).map(|(name, _)| name.as_str()).collect();
    assert!(wrong.is_empty(), "successes that were none:\n{}\n{}", wrong.join("\n"), texts(cells));
}

/// A line for each cell: its name, its exit status and its message.
fn texts(cells: &[(String, Cell)]) -> String {
    cells.iter().map(|(name, cell)| format!("{name}: {} {}\n", cell.status_text(), cell.words)).collect()
}

/// Runs the rows again that differ from the document. The machine is less busy then; on a busy one a command may get no
/// answer in time. Each round checks for false success.
fn run_again(cells: &mut [(String, Cell)]) {
    for (command, row) in COMMANDS.iter().zip(cells.chunks_mut(FAULTS.len())) {
        if !DOCUMENT.contains(&short_row(*command, row)) {
            let start = format!("{} / ", command.arguments);
            row.clone_from_slice(&run_cells(|name| name.starts_with(&start)));
            assert_no_false_success(row);
        }
    }
}

/// Runs the cells whose names are chosen. Returns their names and outcomes, row by row.
fn run_cells(is_chosen: impl Fn(&str) -> bool) -> Vec<(String, Cell)> {
    let all = COMMANDS.iter().flat_map(|command| FAULTS.iter().map(move |fault| (*command, *fault)));
    let name = |(command, fault): &(Command, Fault)| format!("{} / {}", command.arguments, fault.name);
    let chosen: Vec<_> = all.map(|cell| (name(&cell), cell)).filter(|(name, _)| is_chosen(name)).collect();
    let cells = Mutex::new(vec![None; chosen.len()]);
    let next = AtomicUsize::new(0);
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::SeqCst);
            let Some((_, (command, fault))) = chosen.get(number) else { return };
            let cell = run(*command, *fault);
            cells.lock().expect("cells")[number] = Some(cell);
        }
    };
    thread::scope(|scope| (0..THREADS).for_each(|_| drop(scope.spawn(work))));
    let names = chosen.iter().map(|(name, _)| name.clone());
    names.zip(cells.into_inner().expect("cells").into_iter().flatten()).collect()
}

#[test]
fn a_key_of_the_monitor_says_why_the_arm_does_not_obey() {
    let silent = json!({ "do": "fault", "fault": "3=missing" });
    let no_supply = json!({ "do": "fault", "fault": "supply=off" });
    let hot = json!({ "do": "trip", "joint": 3, "alarm": "heat" });
    for (fault, nudge, hold) in [
        (silent, "its servo does not answer", "joint 3 does not answer"),
        (no_supply, "its servo does not answer", "no servo answers"),
        (hot, "joint 3 let go", "joint 3 let go"),
    ] {
        let simulator = Simulator::start(&["--quiet"]);
        let mut control = Control::connect(&simulator.sockets()[0]);
        control.advance(1_500);
        control.result(&fault);
        control.advance(1_500);
        for (keys, refusal) in [("3]", nudge), ("sh", hold)] {
            let port = simulator.ports[0].to_str().expect("text");
            let mut terminal = Terminal::run(sevenbot(), &["monitor", "--port", port]);
            terminal.wait_for("114.0 °/s");
            terminal.keys(keys);
            terminal.wait_for(refusal);
            terminal.keys("q");
            assert!(terminal.wait().success());
        }
    }
}

/// The exit statuses, for the document.
fn short_table(cells: &[(String, Cell)]) -> String {
    let names: Vec<_> = FAULTS.iter().map(|fault| fault.name).collect();
    let mut text =
        format!("| `sevenbot` | {} |\n| --- |{}\n", names.join(" | "), " --: |".repeat(FAULTS.len()));
    for (command, row) in COMMANDS.iter().zip(cells.chunks(FAULTS.len())) {
        text += &short_row(*command, row);
    }
    text
}

fn short_row(command: Command, row: &[(String, Cell)]) -> String {
    let statuses: Vec<_> = row.iter().map(|(_, cell)| cell.status_text()).collect();
    format!("| `{}` | {} |\n", command.arguments.replace("FOLDER/", ""), statuses.join(" | "))
}

/// The table: for each command a line for each fault.
fn table(cells: &[(String, Cell)]) -> String {
    let mut text = String::new();
    for (command, row) in COMMANDS.iter().zip(cells.chunks(FAULTS.len())) {
        let _ = writeln!(text, "{}", command.arguments);
        for (fault, (_, cell)) in FAULTS.iter().zip(row) {
            let status = cell.status_text();
            // After a failure, whether the arm did what was asked depends on the moment of the fault. Leave it out.
            let is_success = cell.status == Some(0);
            let done = match cell.is_done.filter(|_| is_success) {
                None => "",
                Some(true) => "done",
                Some(false) => "not done",
            };
            let _ = writeln!(text, "  {:<13} {status:>3}  {done:<9} {}", fault.name, cell.words);
        }
    }
    text
}
