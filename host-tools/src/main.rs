//! `sevenbot`: a 7Bot V2 arm at the command line.
//!
//! Parses, runs one command, and says how it ended. What the commands do is theirs; how the arm is spoken
//! to is the library's.

#![forbid(unsafe_code)]

mod cli;
mod commands;
mod failure;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use sevenbot::Arm;

use crate::cli::{Cli, Command};
use crate::failure::Failure;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let mut out = anstream::stdout().lock();
    let ended = run(&cli, &mut out);
    // What was found out is shown even where the end of it is a failure.
    let shown = out.flush().map_err(Failure::from);
    match ended.and(shown) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            failure.report(&mut anstream::stderr());
            failure.exit_code()
        }
    }
}

fn run(cli: &Cli, out: &mut impl Write) -> Result<(), Failure> {
    let port = cli.port.as_deref().ok_or(Failure::NoPort)?;
    let opened = Arm::open(port, cli.baud);
    let mut arm = opened.map_err(|error| Failure::Open { port: port.to_owned(), error })?;
    match &cli.command {
        Command::Info => commands::info::run(&mut arm, port, cli.baud, out),
        Command::Get(args) => commands::get::run(&mut arm, args, out),
        Command::Set(args) => commands::set::run(&mut arm, args, out),
        Command::Pose(args) => commands::pose::run(&mut arm, args, out),
        Command::Monitor(args) => commands::monitor::run(&mut arm, args, out),
    }
}
