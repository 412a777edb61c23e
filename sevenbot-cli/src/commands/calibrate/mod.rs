//! `calibrate`: finds the offsets of the joints with the user's help, and stores them.
//!
//! ```text
//!   each joint: nudge it to a mark ──▶ enter the mark's angle ──▶ offset and grade
//!   then: question ──▶ lock open, write, read back, lock closed ──▶ restart ──▶ read again
//! ```
//!
//! No offset is written before the question. With `--yes` there is no question, and no restart.

mod offsets;

use std::io::{self, IsTerminal, Write};
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::Args;
use sevenbot::map::{OFFSET, PRESENT_POSITION};
use sevenbot::{Angle, Arm, Joint, Span};

use self::offsets::{Grade, OffsetTable, Offsets, corrected};
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::interrupt::hold_on_interrupt;
use crate::printer::{Printable, note, warn};
use crate::session::Session;
use crate::step_target::{out_of_range, step_target};
use crate::watch::ProgressWatch;
use crate::write_result::uses_offsets_after_restart;
use sevenbot::moves::JointMove;

/// Find the offsets of the joints, and store them.
///
/// For each joint, bring it to a mark of known angle and enter that angle. Move the joint with +N or -N degrees, or by
/// hand after `sevenbot state forceless`. At the end a question comes before the offsets are written.
#[derive(Debug, Args)]
#[command(after_help = "\
At each joint:
  +5, -2     move the joint by so many degrees
  90         the true angle of the joint: computes the offset
  Enter      keep the offset, go on to the next joint
  q          end, and write nothing

Up to 10 degrees an offset is good, up to 16 acceptable. A larger one is bad and
cannot be stored: assemble the joint again, one tooth further.

Examples:
  sevenbot calibrate
  sevenbot calibrate --show
  sevenbot calibrate --reset  all offsets 0, as they left the factory")]
pub(crate) struct CalibrateArgs {
    /// Show the offsets and their grades, and change nothing.
    #[arg(long, conflicts_with = "reset")]
    show: bool,
    /// Set all offsets to 0.
    #[arg(long)]
    reset: bool,
    /// Write without a question.
    #[arg(long)]
    yes: bool,
}

/// Time limit for the restart of the arm.
const RESTART_TIMEOUT: Duration = Duration::from_secs(20);
const POLL_PERIOD: Duration = Duration::from_millis(500);

pub(crate) fn run(session: &mut Session, args: &CalibrateArgs) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let before = read(&mut arm)?;
    if args.show {
        return session.printer.print(&OffsetTable::new(before, before));
    }
    if !args.yes && !io::stdin().is_terminal() {
        let how = "use --yes to write without a question, or --show";
        return Err(CommandError::Usage(format!("standard input is no terminal: {how}")));
    }
    let wanted = if args.reset { Offsets([0; 7]) } else { ask_offsets(&mut arm, before)? };
    store(session, arm, args, before, wanted)
}

fn read(arm: &mut Arm) -> Result<Offsets, CommandError> {
    Ok(arm.read_span(Span::of(&OFFSET))?.into())
}

/// If the offsets differ, asks for confirmation, writes them, and checks them over a restart; with `--yes` there is neither a
/// question nor a restart. Then prints the offsets.
fn store(
    session: &mut Session,
    mut arm: Arm,
    args: &CalibrateArgs,
    before: Offsets,
    wanted: Offsets,
) -> Result<(), CommandError> {
    if wanted != before {
        if !args.yes {
            OffsetTable::new(before, wanted).write_text(&mut anstream::stderr())?;
        }
        let is_late = uses_offsets_after_restart(&arm);
        let effect =
            if is_late { "The arm uses them after its next restart." } else { "The arm moves a little." };
        confirm(&format!("Write these offsets? {effect}"), args.yes)?;
        let write = |arm: &mut Arm| arm.write_checked(OFFSET.address, &wanted.bytes());
        hold_on_interrupt(&mut arm, |arm, _| Ok(arm.with_open_lock(write)?))?;
        if !args.yes {
            restart(session, arm, wanted)?;
        }
    }
    session.printer.print(&OffsetTable::new(before, wanted))
}

fn ask_offsets(arm: &mut Arm, before: Offsets) -> Result<Offsets, CommandError> {
    let mut wanted = before;
    arm.wait_until_settled()?;
    say("Type +N or -N to move a joint, or its true angle. Enter keeps the offset, q ends.")?;
    for joint in Joint::ALL {
        wanted = wanted.with(joint, ask_offset(arm, joint, before.of(joint))?);
    }
    Ok(wanted)
}

/// The user's input for a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CalibrationInput {
    Keep,
    Quit,
    /// Degrees.
    Nudge(i16),
    Actual(Angle),
}

impl CalibrationInput {
    fn parse(line: &str) -> Option<Self> {
        let line = line.trim();
        match line {
            "" => Some(Self::Keep),
            "q" | "Q" => Some(Self::Quit),
            _ if line.starts_with(['+', '-']) => line.parse().ok().map(Self::Nudge),
            _ => line.parse().ok().and_then(Angle::from_degrees).map(Self::Actual),
        }
    }
}

/// Asks for the offset of one joint, and moves the joint as the user says.
fn ask_offset(arm: &mut Arm, joint: Joint, offset: i16) -> Result<i16, CommandError> {
    loop {
        let measured = arm.read_span(Span::of(&PRESENT_POSITION))?.at(PRESENT_POSITION.of(joint));
        let number = joint.number();
        let grade = Grade::of(offset).word();
        match CalibrationInput::parse(&ask(&format!(
            "joint {number}: reads {measured}°, offset {offset}° ({grade}) > "
        ))?) {
            Some(CalibrationInput::Keep) => return Ok(offset),
            Some(CalibrationInput::Quit) => return Err(CommandError::Arm("nothing was written".to_owned())),
            Some(CalibrationInput::Nudge(degrees)) => nudge(arm, joint, degrees)?,
            Some(CalibrationInput::Actual(actual)) => {
                let found = corrected(joint, offset, measured, actual.degrees());
                let grade = Grade::of(found);
                let style = grade.style();
                say(&format!("  offset {found}°: {style}{}{style:#}", grade.word()))?;
                if grade != Grade::Bad {
                    return Ok(found);
                }
                warn(
                    "the register holds at most 16°: assemble the joint one tooth further, or keep the old offset",
                );
            }
            None => warn("+N or -N moves it, 0 to 180 is its true angle, Enter keeps the offset, q ends"),
        }
    }
}

/// Moves one joint. A refused step, and a joint that does not arrive, are only warnings; other failures end the command.
fn nudge(arm: &mut Arm, joint: Joint, degrees: i16) -> Result<(), CommandError> {
    let moved = hold_on_interrupt(arm, |arm, interrupt| {
        let wanted = step_target(&arm.driven_joints()?, joint, degrees)?;
        let angle = u8::try_from(wanted).ok().and_then(Angle::from_degrees);
        let angle = angle.ok_or_else(|| out_of_range(joint, wanted))?;
        let targets = Joint::ALL.map(|other| (other == joint).then_some(angle.degrees()));
        Ok(JointMove::begin(arm, targets)?.finish(arm, &mut ProgressWatch::new(interrupt))?)
    });
    match moved {
        Err(CommandError::Arm(reason) | CommandError::WithAdvice { message: reason, .. }) => warn(reason),
        Err(failure) => return Err(failure),
        Ok(_) => {}
    }
    Ok(())
}

/// Asks the user to restart the arm, then checks the offsets.
fn restart(session: &Session, mut arm: Arm, wanted: Offsets) -> Result<(), CommandError> {
    let accepted =
        |arm: &mut Arm| Ok::<_, CommandError>(arm.status()?.map(|status| status.frames_accepted()));
    let before = accepted(&mut arm)?;
    // Close the port: it may disappear when the supply is switched off.
    drop(arm);
    ask("The offsets are written. To verify them, switch the arm off and on, then press Enter. > ")?;
    let mut arm = reconnect(session)?;
    if before.is_some() && accepted(&mut arm)? > before {
        warn("the arm was not switched off: its counters continue");
    }
    if read(&mut arm)? != wanted {
        return Err(CommandError::Arm("the arm lost its offsets in the restart".to_owned()));
    }
    note("the arm kept the offsets");
    Ok(())
}

fn reconnect(session: &Session) -> Result<Arm, CommandError> {
    let deadline = Instant::now() + RESTART_TIMEOUT;
    loop {
        match session.connect() {
            Err(_) if Instant::now() < deadline => sleep(POLL_PERIOD),
            ended => return ended,
        }
    }
}

fn say(line: &str) -> Result<(), CommandError> {
    Ok(writeln!(anstream::stderr(), "{line}")?)
}

/// Reads a line from the user.
fn ask(question: &str) -> Result<String, CommandError> {
    let mut err = anstream::stderr();
    write!(err, "{question}")?;
    err.flush()?;
    let mut line = String::new();
    if io::stdin().read_line(&mut line)? == 0 {
        writeln!(err)?;
        return Err(CommandError::Usage("the input has ended before the last question".to_owned()));
    }
    Ok(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn input_is_a_nudge_an_angle_or_a_letter() {
        assert_eq!(CalibrationInput::parse("\n"), Some(CalibrationInput::Keep));
        assert_eq!(CalibrationInput::parse(" +5 \n"), Some(CalibrationInput::Nudge(5)));
        assert_eq!(CalibrationInput::parse("-2\r\n"), Some(CalibrationInput::Nudge(-2)));
        assert_eq!(CalibrationInput::parse("90"), Angle::from_degrees(90).map(CalibrationInput::Actual));
        assert_eq!(CalibrationInput::parse("q"), Some(CalibrationInput::Quit));
        for nonsense in ["181", "ninety", "+", "9 0"] {
            assert_eq!(CalibrationInput::parse(nonsense), None, "{nonsense}");
        }
    }
}
