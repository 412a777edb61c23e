//! `recover`: brings an arm back after an obstacle, an alarm or a lost supply, step by step.
//!
//! ```text
//!   health ──▶ what is wrong, what to do by hand ──▶ question ──▶ motor state 1, targets where it is ──▶ health
//! ```

use std::io::{self, Write};
use std::time::Duration;

use clap::Args;
use serde::Serialize;
use sevenbot::health::{ProblemKind, sentences};
use sevenbot::map::{MOTOR_STATE, motor_state};
use sevenbot::moves::{HELD_DEGREES, MoveError};
use sevenbot::{Arm, Health, Problem};

use super::status::ArmStatus;
use crate::command_error::CommandError;
use crate::confirm::confirm;
use crate::printer::{Printable, note, warn};
use crate::session::{Session, put_right};

/// Bring the arm back after an obstacle, an alarm or a lost supply, step by step.
///
/// Says what is wrong and what you have to do by hand. Then asks, switches the motors on, makes the arm hold where it is, waits,
/// and checks. No joint is sent anywhere else.
#[derive(Debug, Args)]
#[command(after_help = "\
The steps, as far as they are necessary:

1. Shows each problem, and what to do: remove an obstacle, close the emergency
   stop, let a servo cool.
2. Asks whether that is done. A servo that holds again may turn a joint by a few
   degrees: keep clear of the arm.
3. Writes motor state 1, so that servos that let go hold again where they are,
   and sets the targets of blocked joints to their positions; of all joints, if
   the motors were off. It does not do that while no servo answers, or while a
   servo is too hot or has a wrong supply. Firmware that does not tell which
   servo was overloaded needs motor state 2 for a moment: the arm falls unless
   you hold it, and that is asked for separately.
4. Waits, looks again for two seconds, and says what is still wrong.

Examples:
  sevenbot recover
  sevenbot recover --yes
      for a program: the steps by hand are done

Exit status 1 if something is still wrong. The faults of a restart stay until
the controller is switched off and on.")]
pub(crate) struct RecoverArgs {
    /// Do not ask.
    #[arg(long)]
    yes: bool,
}

/// Time limit until servos answer after their supply was switched on.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(3);
const RECOVERY_TIMEOUT: Duration = Duration::from_secs(6);
/// Step 4 ends after this time without a problem for which [`needs_motors`] is true. It is longer than the second after which a
/// joint counts as blocked (D27).
const QUIET_TIME: Duration = Duration::from_secs(2);
const POLL_PERIOD: Duration = Duration::from_millis(100);
/// How long the motors are off to end an overload (forceless, then servo).
const OFF_TIME: Duration = Duration::from_millis(500);

#[derive(Serialize)]
struct Recovered {
    recovered: bool,
    /// The problems before the recovery.
    before: Vec<String>,
    status: ArmStatus,
}

impl Printable for Recovered {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        self.status.write_text(out)?;
        match (self.recovered, self.before.as_slice()) {
            (true, []) => writeln!(out, "there was nothing to recover from: the motors hold the arm"),
            (true, _) => writeln!(out, "recovered: the motors hold the arm where it is"),
            (false, _) => Ok(()),
        }
    }
}

pub(crate) fn run(session: &mut Session, args: &RecoverArgs) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    arm.wait_until_settled()?;
    let before = arm.health()?;
    let wrong = before.problems();
    if !wrong.is_empty() || !before.is_driven() {
        tell(&before);
        recover(&mut arm, &before, args.yes)?;
    }
    let after = wait_until_well(&mut arm)?;
    let left = after.problems();
    let mut away = after.away_from_targets(u8::MAX);
    away.retain(|(_, position, target)| position.abs_diff(*target) > HELD_DEGREES);
    let recovered = left.is_empty() && after.is_driven() && away.is_empty();
    let before = wrong.iter().map(Problem::to_string).collect();
    session.printer.print(&Recovered { recovered, before, status: ArmStatus::from(&after) })?;
    match (recovered, after.is_driven()) {
        (true, _) => Ok(()),
        (_, true) if left.is_empty() => Err(MoveError::NotHeld { away }.into()),
        (_, true) => Err(CommandError::Arm(format!("not recovered: {}", sentences(&left)))),
        (_, false) => Err(CommandError::Arm("not recovered: the motors are off".to_owned())),
    }
}

/// Step 1 of the help text: shows each problem and what to do.
fn tell(health: &Health) {
    for problem in health.problems() {
        warn(problem);
        note(format_args!("to do: {}", problem.kind.remedy()));
    }
    if health.problems().is_empty() {
        note("the motors are off, and nothing is wrong: they will be switched on");
    }
}

/// Steps 2 and 3, if they are necessary: asks, then switches the motors on.
fn recover(arm: &mut Arm, before: &Health, yes: bool) -> Result<(), CommandError> {
    put_right(arm)?;
    if before.is_driven() && before.problems().iter().all(|problem| !needs_motors(problem.kind)) {
        return Ok(());
    }
    confirm(
        "Is that done, the arm supported, and nothing in its way? The motors then hold the arm where it is. Go on?",
        yes,
    )?;
    let now = wait_for_servos(arm)?;
    let prevents = |problem: &&Problem| prevents_motors(problem.kind);
    let preventing: Vec<Problem> = now.problems().iter().filter(prevents).copied().collect();
    if !preventing.is_empty() {
        note("the motors were not switched on");
        return Err(CommandError::Problems(preventing));
    }
    if now.problems().contains(&Problem::of_arm(ProblemKind::ServoBus)) {
        confirm(
            "This firmware ends an overload only with the motors off for a moment: the arm falls. Do you hold it?",
            yes,
        )?;
        arm.write_motion(MOTOR_STATE.address, &[motor_state::FORCELESS])?;
        arm.sleep(OFF_TIME);
    }
    arm.write_motion(MOTOR_STATE.address, &[motor_state::SERVO])?;
    // The joints may need some time: step 4 watches them.
    if before.is_driven() && before.joints.iter().all(|joint| joint.is_blocked.is_some()) {
        return free_blocked_joints(arm, &now);
    }
    arm.hold().map(drop).map_err(|error| MoveError::from(error).into())
}

/// Writes the measured position of each blocked joint as its target: a new target lets it hold there (D27). A joint that let go
/// engages by itself (D28). The others keep their targets: a loaded joint would sink a little if its measured position became
/// its target.
fn free_blocked_joints(arm: &mut Arm, health: &Health) -> Result<(), CommandError> {
    let mut targets = [None; 7];
    for (target, joint) in targets.iter_mut().zip(&health.joints) {
        *target = joint.position.filter(|_| joint.is_blocked == Some(true));
    }
    if targets.iter().any(Option::is_some) {
        arm.set_fine_targets_checked(&targets)?;
    }
    Ok(())
}

/// Does the problem need step 3: a write of the motor state, or of targets?
const fn needs_motors(kind: ProblemKind) -> bool {
    kind.ends_moves() || kind.is_alarm() || matches!(kind, ProblemKind::ServoBus)
}

/// Does the problem make it useless or harmful to switch the motors on?
const fn prevents_motors(kind: ProblemKind) -> bool {
    matches!(kind, ProblemKind::NoServoAnswers | ProblemKind::Overheat | ProblemKind::Voltage)
}

/// The health once a servo answers, or after [`ANSWER_TIMEOUT`].
fn wait_for_servos(arm: &mut Arm) -> Result<Health, CommandError> {
    let deadline = arm.now() + ANSWER_TIMEOUT;
    loop {
        let health = arm.health()?;
        let is_silent = health.problems().contains(&Problem::of_arm(ProblemKind::NoServoAnswers));
        if !is_silent || arm.now() >= deadline {
            return Ok(health);
        }
        arm.sleep(POLL_PERIOD);
    }
}

/// Step 4: the health once the motors have held the arm for [`QUIET_TIME`] without a problem for which [`needs_motors`] is
/// true, or the first one after [`RECOVERY_TIMEOUT`] with such a problem or without motors.
fn wait_until_well(arm: &mut Arm) -> Result<Health, CommandError> {
    let start = arm.now();
    let mut well_since = start;
    loop {
        let health = arm.health()?;
        let now = arm.now();
        let is_well =
            health.is_driven() && health.problems().iter().all(|problem| !needs_motors(problem.kind));
        if !is_well {
            well_since = now;
        }
        if now >= well_since + QUIET_TIME || (!is_well && now >= start + RECOVERY_TIMEOUT) {
            return Ok(health);
        }
        arm.sleep(POLL_PERIOD);
    }
}
