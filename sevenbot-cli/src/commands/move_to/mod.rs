//! `move-to`: moves the tip to a point in millimetres.
//!
//! ```text
//!   x y z, tool ──▶ TipTarget, or TipRefusal ──▶ Guard of the way ──▶ JointMove, as for `pose`
//!              └──▶ StraightLine, or StraightLineError ──▶ played like a recording
//! ```

use sevenbot::Arm;
use sevenbot::cartesian::{TipTarget, Vector};
use sevenbot::fine::FineTargets;
use sevenbot::moves::{JointMove, TipMove};

use crate::command_error::CommandError;
use crate::interrupt::hold_on_interrupt;
use crate::measured_pose::MeasuredPose;
use crate::printer::note;
use crate::session::Session;
use crate::watch::{ProgressWatch, note_other_pace, note_rounding};

mod args;
mod facts;
mod straight;

pub(crate) use args::MoveToArgs;
use args::target;
use facts::TipArrival;

pub(crate) fn run(session: &mut Session, args: &MoveToArgs) -> Result<(), CommandError> {
    if args.straight {
        return straight::run(session, args);
    }
    let Some(tool) = args.tool() else {
        let mut arm = args.connect(session)?;
        let tool = present_tool(&mut arm)?;
        let target = target(args, tool)?;
        return take(session, Some(arm), args, &target, tool);
    };
    // Check the point before opening the arm.
    let target = target(args, tool)?;
    let arm = if args.dry_run { None } else { Some(session.connect_to_move()?) };
    take(session, arm, args, &target, tool)
}

/// Shows the move and, without --dry-run, makes it.
fn take(
    session: &mut Session,
    arm: Option<Arm>,
    args: &MoveToArgs,
    target: &TipTarget,
    tool: Vector,
) -> Result<(), CommandError> {
    let arrival = TipArrival::planned(args.tip(), target, tool);
    let Some(mut arm) = arm else { return print_without_arm(session, args, target, tool) };
    let TipMove { targets, fine } = TipMove::of(&mut arm, target, args.tip(), tool)?;
    let arrival = fine.iter().fold(arrival, TipArrival::in_hundredths);
    if args.dry_run {
        args.guard.check_way(&mut arm, &targets)?;
        return session.printer.print(&arrival);
    }
    let measured = move_to(&mut arm, targets, args)?;
    session.printer.print(&arrival.with_measured(measured))
}

/// Shows the move without an arm, as this project's firmware would make it: with targets in hundredths of a degree, or in whole
/// degrees if the rounded hundredths break a limit.
fn print_without_arm(
    session: &mut Session,
    args: &MoveToArgs,
    target: &TipTarget,
    tool: Vector,
) -> Result<(), CommandError> {
    let arrival = TipArrival::planned(args.tip(), target, tool);
    let Some(fine) = target.in_hundredths(args.tip(), tool) else { return session.printer.print(&arrival) };
    note(format_args!("an arm that takes whole degrees misses the point by {:.1} mm", target.miss_mm));
    session.printer.print(&arrival.in_hundredths(&fine))
}

/// The present direction of the tool.
fn present_tool(arm: &mut Arm) -> Result<Vector, CommandError> {
    let positions = arm.wait_until_settled()?.positions();
    Ok(MeasuredPose::read(arm, positions)?.tip_pose().tool)
}

/// Moves joints 1 to 5, if the guard allows their way. With --wait waits and returns the measured angles.
fn move_to(
    arm: &mut Arm,
    targets: FineTargets,
    args: &MoveToArgs,
) -> Result<Option<MeasuredPose>, CommandError> {
    hold_on_interrupt(arm, |arm, interrupt| {
        arm.driven_joints()?;
        args.guard.check_way(arm, &targets)?;
        note_other_pace(arm, &targets)?;
        interrupt.check()?;
        let begun = JointMove::begin_fine(arm, targets)?;
        note_rounding(&begun);
        if !args.wait {
            return Ok(None);
        }
        let positions = begun.finish(arm, &mut ProgressWatch::new(interrupt))?;
        Ok(Some(MeasuredPose::read(arm, positions)?))
    })
}
