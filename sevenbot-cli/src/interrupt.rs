//! Ctrl-C while the arm moves: the first one leaves it holding where it is, the second one ends at once.
//!
//! A command that moves nothing does not catch it, and ends as any program does; so does a question between two
//! moves.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use sevenbot::Arm;
use sevenbot::joints::JointSnapshot;
use sevenbot::register_text::{self, motor_state_name};

use crate::command_error::{CommandError, INTERRUPTED};
use crate::printer::{note, warn};

/// How often Ctrl-C was pressed, or another wish to end came.
static REQUESTS: AtomicU32 = AtomicU32::new(0);
/// Does the arm move, so that it would have to be stopped?
static MOVING: AtomicBool = AtomicBool::new(false);
static HANDLER: Once = Once::new();
/// A wait looks this often whether it should end.
const POLL_PERIOD: Duration = Duration::from_millis(20);

/// The user's wish to end, from now on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interrupt(());

impl Interrupt {
    /// Catches Ctrl-C, and the signals that ask a program to end, from now on. Where that is not possible
    /// they end the program, as without.
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

    /// The arm does not move any more: from now on the wish ends the program at once.
    fn release() {
        MOVING.store(false, Ordering::SeqCst);
    }

    /// The user pressed Ctrl-C where that is a key and no signal. The signal ends the program from now on.
    pub(crate) fn request() {
        REQUESTS.fetch_add(1, Ordering::SeqCst);
    }

    /// Did the user want a command to end, in whatever thread it runs?
    pub(crate) fn is_requested() -> bool {
        REQUESTS.load(Ordering::SeqCst) > 0
    }

    /// Fails if the user wants it to end.
    pub(crate) fn check(self) -> Result<(), CommandError> {
        if Self::is_requested() { Err(CommandError::Interrupted) } else { Ok(()) }
    }

    /// Sleeps; less if the user wants it to end, which is then a failure.
    pub(crate) fn sleep(self, duration: Duration) -> Result<(), CommandError> {
        let end = Instant::now() + duration;
        loop {
            self.check()?;
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            sleep(left.min(POLL_PERIOD));
        }
    }
}

/// Does work that may move the arm. Interrupted at any time, it leaves the arm holding where it is.
pub(crate) fn hold_on_interrupt<T>(
    arm: &mut Arm,
    work: impl FnOnce(&mut Arm, Interrupt) -> Result<T, CommandError>,
) -> Result<T, CommandError> {
    let interrupt = Interrupt::catch();
    let done = work(arm, interrupt);
    Interrupt::release();
    if !Interrupt::is_requested() {
        return done;
    }
    let interrupt = Interrupt::catch();
    let held = hold(arm);
    Interrupt::release();
    report_hold(&held?);
    interrupt.check()?;
    done
}

/// Makes the arm hold where it is, and makes sure of it.
pub(crate) fn hold(arm: &mut Arm) -> Result<JointSnapshot, CommandError> {
    arm.hold().map_err(|reason| CommandError::MayMove(reason.to_string()))
}

/// Says what an arm does that was made to hold.
pub(crate) fn report_hold(joints: &JointSnapshot) {
    if joints.is_driven() {
        note("the arm holds where it is");
    }
    warn_about_unheld_joints(joints);
}

/// Warns of joints that a stop does not reach.
pub(crate) fn warn_about_unheld_joints(joints: &JointSnapshot) {
    if !joints.is_driven() {
        let (state, word) = (joints.motor_state(), motor_state_name(joints.motor_state()));
        warn(format_args!("the motors are in state {state}, {word}: they do not drive the joints"));
    } else if joints.missing() != 0 {
        let silent = register_text::joints(joints.missing());
        warn(format_args!(
            "no answer from the servos of {silent}: where they are is not known. Switch the supply of the servos \
             off before you reach into the arm"
        ));
    }
}
