//! `stop`: every joint holds where it is.

use super::pose::Positions;
use crate::command_error::CommandError;
use crate::interrupt::{hold, warn_about_unheld_joints};
use crate::printer::warn;
use crate::session::Session;

/// Stop: every joint holds where it is.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Targets become the measured positions; they are read back, and written again where they did not take.
Where the motors are off (state 0 or 2) nothing is written.

Exit status 1 when it is not known that the arm holds: it may still be moving then.")]
pub(crate) struct StopArgs {}

pub(crate) fn run(session: &mut Session) -> Result<(), CommandError> {
    let connected = session.connect();
    let mut arm = connected.inspect_err(|_| {
        warn("the arm was not told to stop and may be moving; the switch of the servos' supply stops it");
    })?;
    let joints = hold(&mut arm)?;
    warn_about_unheld_joints(&joints);
    let positions_degrees = if joints.is_driven() { joints.targets() } else { joints.positions() };
    session.printer.print(&Positions { positions_degrees })
}
