//! Ctrl-C after [`Interrupt::catch`]: the first requests the end of the command, the second ends the program. A command that
//! moves the arm then makes it hold its position ([`hold_on_interrupt`]).
//!
//! Otherwise Ctrl-C ends the program.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use sevenbot::Arm;
use sevenbot::joints::JointSnapshot;
use sevenbot::register_text::{self, motor_state_name};

use crate::command_error::{CommandError, INTERRUPTED};
use crate::printer::{note, warn};

/// Number of requests to end: Ctrl-C or a signal.
static REQUESTS: AtomicU32 = AtomicU32::new(0);
/// Does the first Ctrl-C only request the end? So from `Interrupt::catch` to `Interrupt::release`.
static MOVING: AtomicBool = AtomicBool::new(false);
static HANDLER: Once = Once::new();

/// Shows that [`Interrupt::catch`] was called. If it could not set its handler, Ctrl-C still ends the program.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interrupt(());

impl Interrupt {
    /// Catches Ctrl-C, SIGTERM and SIGHUP. If the handler cannot be set, they end the program.
    pub(crate) fn catch() -> Self {
        MOVING.store(true, Ordering::SeqCst);
        HANDLER.call_once(|| {
            let _ = ctrlc::set_handler(|| {
                if !MOVING.load(Ordering::SeqCst) || REQUESTS.fetch_add(1, Ordering::SeqCst) > 0 {
                    std::process::exit(i32::from(INTERRUPTED));
                }
            });
        });
        Self(())
    }

    /// The work has ended: Ctrl-C ends the program again.
    fn release() {
        MOVING.store(false, Ordering::SeqCst);
    }

    /// Requests the end, where Ctrl-C arrives as a key. A later signal ends the program at once.
    pub(crate) fn request() {
        REQUESTS.fetch_add(1, Ordering::SeqCst);
    }

    /// Has the user requested the end?
    pub(crate) fn is_requested() -> bool {
        REQUESTS.load(Ordering::SeqCst) > 0
    }

    /// Fails if the user has requested the end.
    pub(crate) fn check(self) -> Result<(), CommandError> {
        if Self::is_requested() { Err(CommandError::Interrupted) } else { Ok(()) }
    }
}

/// Runs `work`, which may move the arm. After an interrupt, makes the arm hold its position, and fails with
/// [`CommandError::Interrupted`], or with the failure of the hold. After another failure, warns if the arm may be moving.
pub(crate) fn hold_on_interrupt<T>(
    arm: &mut Arm,
    work: impl FnOnce(&mut Arm, Interrupt) -> Result<T, CommandError>,
) -> Result<T, CommandError> {
    let interrupt = Interrupt::catch();
    let done = work(arm, interrupt);
    Interrupt::release();
    if matches!(done, Err(CommandError::Exchange(_))) {
        warn("the arm may be moving: switch off the supply of the servos if something is in its way");
    }
    if !Interrupt::is_requested() {
        if matches!(done, Err(CommandError::Problems(_))) {
            warn_about_moving_joints(arm);
        }
        return done;
    }
    let interrupt = Interrupt::catch();
    let held = hold(arm);
    Interrupt::release();
    report_hold(&held?);
    interrupt.check()?;
    done
}

/// Warns about joints that still move although a problem of another joint has ended the move.
fn warn_about_moving_joints(arm: &mut Arm) {
    if let Ok(Some(status)) = arm.status()
        && status.moving() != 0
    {
        let moving = register_text::joints(status.moving());
        warn(format_args!("still moving: {moving}; `sevenbot stop` makes the arm hold"));
    }
}

/// Makes the arm hold its position, and watches whether it does. Warns about joints that may not.
pub(crate) fn hold(arm: &mut Arm) -> Result<JointSnapshot, CommandError> {
    let held = arm.hold_and_watch().map_err(CommandError::from);
    if let Err(CommandError::Problems(_)) = &held
        && let Ok(joints) = arm.joints()
    {
        warn_about_unheld_joints(&joints);
    }
    held
}

/// Tells the user whether the arm holds.
pub(crate) fn report_hold(joints: &JointSnapshot) {
    if joints.is_driven() {
        note("the arm holds where it is");
    }
    warn_about_unheld_joints(joints);
}

/// Warns about joints that a stop does not affect.
pub(crate) fn warn_about_unheld_joints(joints: &JointSnapshot) {
    if !joints.is_driven() {
        let (state, word) = (joints.motor_state(), motor_state_name(joints.motor_state()));
        warn(format_args!("the motors are in state {state}, {word}: they do not drive the joints"));
    } else if joints.missing() != 0 {
        let silent = register_text::joints(joints.missing());
        warn(format_args!(
            "no answer from the servos of {silent}: their positions are unknown. Switch off the supply of the servos \
             before you reach into the arm"
        ));
    }
}
