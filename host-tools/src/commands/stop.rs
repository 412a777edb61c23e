//! `stop`: every joint holds where it is.

use sevenbot::Angle;

use super::pose::Stand;
use crate::failure::Failure;
use crate::session::Session;

/// Stop: every joint holds where it is.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Targets become the measured positions. A joint whose servo does not answer is left alone.")]
pub(crate) struct StopArgs {}

pub(crate) fn run(session: &mut Session) -> Result<(), Failure> {
    let mut arm = session.connect()?;
    arm.hold()?;
    let positions_degrees = arm.targets()?.map(Angle::degrees);
    session.output.show(&Stand { positions_degrees })
}
