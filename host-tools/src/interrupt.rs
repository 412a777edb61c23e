//! Ctrl-C while the arm moves: the first one leaves it holding where it is, the second one ends at once.
//!
//! A command that moves nothing does not catch it, and ends as any program does; so does a question between two
//! moves.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use sevenbot::Arm;

use crate::failure::{Failure, INTERRUPTED};
use crate::output::note;

/// How often Ctrl-C was pressed, or another wish to end came.
static WISHES: AtomicU32 = AtomicU32::new(0);
/// Does the arm move, so that it would have to be stopped?
static MOVING: AtomicBool = AtomicBool::new(false);
static CATCHING: Once = Once::new();
/// A wait looks this often whether it should end.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// The user's wish to end, from now on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interrupt(());

impl Interrupt {
    /// Catches Ctrl-C, and the signals that ask a program to end, from now on. Where that is not possible
    /// they end the program, as without.
    pub(crate) fn catch() -> Self {
        MOVING.store(true, Ordering::SeqCst);
        CATCHING.call_once(|| {
            let _ = ctrlc::set_handler(|| {
                if !MOVING.load(Ordering::SeqCst) || WISHES.fetch_add(1, Ordering::SeqCst) > 0 {
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

    /// Does the user want it to end?
    pub(crate) fn has_come(self) -> bool {
        WISHES.load(Ordering::SeqCst) > 0
    }

    /// Fails if the user wants it to end.
    pub(crate) fn check(self) -> Result<(), Failure> {
        if self.has_come() { Err(Failure::Interrupted) } else { Ok(()) }
    }

    /// Sleeps; less if the user wants it to end, which is then a failure.
    pub(crate) fn sleep(self, duration: Duration) -> Result<(), Failure> {
        let end = Instant::now() + duration;
        loop {
            self.check()?;
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            sleep(left.min(LOOK_EVERY));
        }
    }
}

/// Does work that moves the arm. Interrupted, it leaves the arm holding where it is.
pub(crate) fn or_hold<T>(
    arm: &mut Arm,
    work: impl FnOnce(&mut Arm, Interrupt) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let interrupt = Interrupt::catch();
    let done = work(arm, interrupt);
    if matches!(done, Err(Failure::Interrupted)) {
        arm.hold()?;
        note("the arm holds where it is");
    }
    Interrupt::release();
    done
}
