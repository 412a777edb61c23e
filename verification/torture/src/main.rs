//! Tries the arm in worlds where everything goes wrong, or loads a port.

use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use torture::campaign::{self, Outcome, Plan};
use torture::cli::{Command, Options};
use torture::load;
use torture::sag;
use torture::table::{Table, days};

fn main() -> ExitCode {
    let options = Options::parse();
    match &options.command {
        Some(Command::Load(options)) => load_port(options),
        Some(Command::Sag) => measure_sag(),
        None => try_worlds(&options.plan(), options.rows),
    }
}

fn try_worlds(plan: &Plan, as_rows: bool) -> ExitCode {
    let is_seen = io::stderr().is_terminal();
    let outcome = campaign::run(plan, |outcome, elapsed| {
        if is_seen {
            show_progress(outcome, elapsed);
        }
    });
    if is_seen {
        let _ = write!(io::stderr(), "\r{:60}\r", "");
    }
    if let Some(failure) = &outcome.failure {
        let scenario =
            plan.scenario.map_or_else(String::new, |scenario| format!(" --scenario {}", scenario.name));
        say(&format!("{}\nThe same again: torture --seed {}{scenario}\n", failure.story, failure.seed));
    }
    let table = Table(plan, &outcome);
    if as_rows {
        table.rows().iter().for_each(|row| say(&row.join("\t")));
        say(&table.pace());
    } else {
        say(&table.to_string());
    }
    if outcome.is_good() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn show_progress(outcome: &Outcome, elapsed: Duration) {
    let (worlds, tally) = outcome.total();
    let line = format!("{worlds} worlds, {:.2} virtual days in {} s", days(tally.micros), elapsed.as_secs());
    let _ = write!(io::stderr(), "\r{line:60}");
}

fn measure_sag() -> ExitCode {
    say(&sag::Table::measure().to_string());
    ExitCode::SUCCESS
}

fn load_port(options: &load::Options) -> ExitCode {
    match load::run(options) {
        Ok(tally) => {
            say(&tally.to_string());
            ExitCode::from(u8::from(!tally.is_clean()))
        }
        Err(failure) => {
            let _ = writeln!(io::stderr(), "error: {failure}");
            ExitCode::from(2)
        }
    }
}

/// Nobody has to read it.
fn say(text: &str) {
    let _ = writeln!(io::stdout(), "{text}");
}
