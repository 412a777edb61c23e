//! Simulates the arm with injected faults, saturates a port, or measures the sag or the effect of obstacles.

use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use torture::campaign::{self, CampaignPlan, CampaignResult};
use torture::cli::{CampaignArgs, TortureCommand};
use torture::load;
use torture::obstacles::{Experiments, SimulatedObstacleArm};
use torture::result_table::{ResultTable, days};
use torture::sag;

fn main() -> ExitCode {
    let args = CampaignArgs::parse();
    match &args.command {
        Some(TortureCommand::Load(args)) => load_port(args),
        Some(TortureCommand::Sag) => measure_sag(),
        Some(TortureCommand::Obstacles) => measure_obstacles(),
        None => run_campaign(&args.plan(), args.rows),
    }
}

fn run_campaign(plan: &CampaignPlan, as_rows: bool) -> ExitCode {
    let has_terminal = io::stderr().is_terminal();
    let result = campaign::run(plan, |result, elapsed| {
        if has_terminal {
            show_progress(result, elapsed);
        }
    });
    if has_terminal {
        let _ = write!(io::stderr(), "\r{:60}\r", "");
    }
    if let Some(failure) = &result.failure {
        let scenario =
            plan.scenario.map_or_else(String::new, |scenario| format!(" --scenario {}", scenario.name));
        print_line(&format!("{}\nTo repeat: torture --seed {}{scenario}\n", failure.log, failure.seed));
    }
    let table = ResultTable(plan, &result);
    if as_rows {
        table.rows().iter().for_each(|row| print_line(&row.join("\t")));
        print_line(&table.pace());
    } else {
        print_line(&table.to_string());
    }
    if result.passed() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn show_progress(result: &CampaignResult, elapsed: Duration) {
    let (worlds, counts) = result.total();
    let line = format!("{worlds} worlds, {:.2} virtual days in {} s", days(counts.micros), elapsed.as_secs());
    let _ = write!(io::stderr(), "\r{line:60}");
}

fn measure_sag() -> ExitCode {
    print_line(&sag::SagTable::measure().to_string());
    ExitCode::SUCCESS
}

fn measure_obstacles() -> ExitCode {
    let Ok(tables) = Experiments::all().measure::<SimulatedObstacleArm>();
    print_line(&tables);
    ExitCode::SUCCESS
}

fn load_port(args: &load::LoadArgs) -> ExitCode {
    match load::run(args) {
        Ok(counts) => {
            print_line(&counts.to_string());
            ExitCode::from(u8::from(!counts.is_clean()))
        }
        Err(failure) => {
            let _ = writeln!(io::stderr(), "error: {failure}");
            ExitCode::from(2)
        }
    }
}

/// Prints a line. A closed pipe is no error.
fn print_line(text: &str) {
    let _ = writeln!(io::stdout(), "{text}");
}
