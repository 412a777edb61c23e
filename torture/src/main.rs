//! The command line.
use std::process::ExitCode;

use clap::Parser;

#[derive(Parser)]
enum Options {
    /// Load a port
    Load(torture::load::Options),
}

fn main() -> ExitCode {
    let Options::Load(options) = Options::parse();
    match torture::load::run(&options) {
        Ok(tally) => {
            println!("{tally}");
            ExitCode::from(u8::from(!tally.is_clean()))
        }
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::from(2)
        }
    }
}
