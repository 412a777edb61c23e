//! `stop`: makes every joint hold its position.

use super::pose::Positions;
use crate::command_error::CommandError;
use crate::interrupt::{hold, warn_about_unheld_joints};
use crate::printer::warn;
use crate::session::Session;

/// Stop: make every joint hold its position.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sets the targets to the measured positions, reads them back, and repeats the
write if necessary. Then watches for half a second whether the joints hold.
Writes nothing if the motors are off (state 0 or 2).

Exit status 1 if the arm may not hold: it may still be moving, a joint does not
answer or has let go, or another program sends it elsewhere. 3 if it received no
stop, because the port cannot be opened or no arm answers.")]
pub(crate) struct StopArgs {}

pub(crate) fn run(session: &mut Session) -> Result<(), CommandError> {
    let connected = session.connect();
    let mut arm = connected.inspect_err(|_| {
        warn("the arm received no stop and may be moving; switch off the supply of the servos to stop it");
    })?;
    let joints = hold(&mut arm)?;
    warn_about_unheld_joints(&joints);
    let positions_degrees = if joints.is_driven() { joints.targets() } else { joints.positions() };
    session.printer.print(&Positions { positions_degrees })
}
