//! The arguments of a load, and its errors.

use std::io;

use clap::Args;

/// The port, and the size of the load.
#[derive(Clone, Debug, Args)]
pub struct LoadArgs {
    /// Port to load
    #[arg(long, value_name = "PATH")]
    pub port: String,

    /// Duration in minutes
    #[arg(long, default_value_t = 1.0)]
    pub minutes: f64,

    /// Baud rate; a simulated port accepts any
    #[arg(long, default_value_t = 115_200)]
    pub baud: u32,

    /// Largest number of pending reads
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub window: u32,

    /// Process whose memory to watch
    #[arg(long)]
    pub pid: Option<u32>,
}

/// Why a load did not begin, or ended early.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The port cannot be opened, for example because no simulator serves it.
    #[error("cannot open {port}: {cause}: is the simulator running?")]
    Port {
        /// The port as it was given on the command line.
        port: String,
        /// The reason that the library of serial ports gives.
        cause: serialport::Error,
    },
    /// A read or a write of the port failed, for example because the port was removed.
    #[error("the port is gone: {0}")]
    Gone(#[from] io::Error),
    /// The duration is not above 0, or too long for a [`Duration`](std::time::Duration).
    #[error("--minutes {0}: use a number above 0")]
    Minutes(f64),
}
