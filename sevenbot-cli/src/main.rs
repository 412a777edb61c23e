//! `sevenbot`: a 7Bot V2 arm at the command line.
//!
//! ```text
//!   cli ──▶ Session ──▶ commands ──▶ sevenbot (the library) ──▶ arm
//!                          │
//!                          └──▶ Printer (results as text or JSON), or a CommandError (message and exit status)
//! ```
//!
//! Parses the arguments, runs one command, and reports its result.

#![forbid(unsafe_code)]

mod advice;
mod approach_args;
mod cli;
mod command_error;
mod commands;
mod confirm;
mod guard_args;
mod input_file;
mod interrupt;
mod line_file;
mod measured_pose;
mod output_file;
mod page_file;
mod plot;
mod printer;
mod progress;
mod register_parser;
mod secret;
mod session;
mod settings_file;
mod space_plot;
mod step_target;
mod style;
mod svg;
mod watch;
mod write_result;

use std::io;
use std::process::ExitCode;
use std::time::Duration;

use sevenbot::ArmOptions;
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::fmt::time::uptime;

use crate::cli::Cli;
use crate::printer::Printer;
use crate::session::Session;

fn main() -> ExitCode {
    let Cli { global, command } =
        Cli::from_arguments(std::env::args_os()).unwrap_or_else(|error| error.exit());
    if global.verbose {
        show_frames();
    }
    let printer = Printer::stdout(global.json);
    // An empty SEVENBOT_PORT counts as not set.
    let port = global.port.filter(|port| !port.is_empty());
    let reply_timeout = Duration::from_millis(global.timeout.into());
    let options = ArmOptions { baud: global.baud, reply_timeout, map: global.map, ..ArmOptions::default() };
    let mut session = Session { port, options, printer, log: global.log };
    match command.run(&mut session) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.report(&mut anstream::stderr(), global.json);
            failure.exit_code()
        }
    }
}

/// Prints the library's log, with every frame, on standard error.
fn show_frames() {
    tracing_subscriber::fmt()
        .with_max_level(LevelFilter::TRACE)
        .with_target(false)
        .with_level(false)
        .with_ansi(false)
        .with_timer(uptime())
        .with_writer(io::stderr)
        .init();
}
