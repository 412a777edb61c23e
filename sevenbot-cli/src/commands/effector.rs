//! `vacuum`, `effector`: the pump, and the type of tool.

use clap::{Args, ValueEnum};
use sevenbot::map::{EFFECTOR_TYPE, VACUUM_PUMP};
use sevenbot::register_text::entries;
use sevenbot::{Register, Span};

use super::get::RegisterList;
use crate::command_error::CommandError;
use crate::session::Session;

/// Show or switch the vacuum pump.
#[derive(Debug, Args)]
pub(crate) struct VacuumArgs {
    /// The state of the pump.
    vacuum: Option<PumpState>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PumpState {
    /// The pump runs, the valve is closed.
    #[value(alias = "suck")]
    On,
    /// The pump stops, and the valve opens for half a second.
    #[value(alias = "release")]
    Off,
}

/// Show or set the type of tool.
#[derive(Debug, Args)]
pub(crate) struct EffectorArgs {
    /// The type of tool.
    effector: Option<Effector>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Effector {
    /// A suction cup.
    SuctionCup,
    /// A gripper, driven by joint 7.
    Gripper,
}

pub(crate) fn vacuum(session: &mut Session, args: &VacuumArgs) -> Result<(), CommandError> {
    let value = args.vacuum.map(|wanted| matches!(wanted, PumpState::On).into());
    show_or_set(session, &VACUUM_PUMP, value)
}

pub(crate) fn effector(session: &mut Session, args: &EffectorArgs) -> Result<(), CommandError> {
    let value = args.effector.map(|wanted| matches!(wanted, Effector::Gripper).into());
    show_or_set(session, &EFFECTOR_TYPE, value)
}

fn show_or_set(session: &mut Session, row: &Register, value: Option<u8>) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    if let Some(value) = value {
        arm.write_checked(row.address, &[value])?;
    }
    session.printer.print(&RegisterList::from(entries(&arm.read_span(Span::of(row))?)))
}
