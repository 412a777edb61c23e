//! `sevenbot`: a 7Bot V2 arm at the command line.
//!
//! ```text
//!   cli ──▶ Session ──▶ commands ──▶ sevenbot (the library) ──▶ arm
//!                          │
//!                          └──▶ Output (facts, as text or JSON), or a Failure (words and exit status)
//! ```
//!
//! Parses, runs one command, and says how it ended. What the commands do is theirs; how the arm is spoken
//! to is the library's.

#![forbid(unsafe_code)]

mod cli;
mod commands;
mod confirm;
mod failure;
mod interrupt;
mod moving;
mod output;
mod plot;
mod progress;
mod session;
mod settings_file;

use std::process::ExitCode;

use clap::Parser;

use crate::cli::Cli;
use crate::output::Output;
use crate::session::Session;

fn main() -> ExitCode {
    let Cli { global, command } = Cli::parse();
    let output = Output::stdout(global.json);
    let mut session = Session { port: global.port, baud: global.baud, output };
    match command.run(&mut session) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.report(&mut anstream::stderr());
            failure.exit_code()
        }
    }
}
