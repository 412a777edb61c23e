//! Starts all programs of a turn together, and ends them.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use system_tests::wait::TIMEOUT;

#[derive(Default)]
struct Turns {
    /// Turns so far.
    count: usize,
    /// Programs that have begun this turn.
    begun: usize,
    is_over: bool,
}

/// Lets all programs begin each turn together.
#[derive(Default)]
pub(crate) struct Gate {
    turns: Mutex<Turns>,
    changed: Condvar,
}

thread_local! {
    /// The turn that this thread is in.
    static TURN: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

/// Ends all programs when it is dropped, also by a panic.
pub(crate) struct End<'a>(&'a Gate);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.lock().is_over = true;
        self.0.changed.notify_all();
    }
}

impl Gate {
    pub(crate) const fn ends_others(&self) -> End<'_> {
        End(self)
    }

    /// Begins the next turn, and waits until this number of programs has begun it. Panics if a program has failed, and after
    /// [`TIMEOUT`].
    pub(crate) fn release(&self, programs: usize) {
        let mut turns = self.lock();
        turns.count += 1;
        turns.begun = 0;
        self.changed.notify_all();
        let waits = |turns: &mut Turns| turns.begun < programs && !turns.is_over;
        turns =
            self.changed.wait_timeout_while(turns, TIMEOUT, waits).unwrap_or_else(PoisonError::into_inner).0;
        assert!(!turns.is_over, "a program failed");
        assert!(turns.begun >= programs, "timeout: {} of {programs} programs have begun", turns.begun);
    }

    /// Waits for the next turn. Returns false at the end.
    pub(crate) fn wait(&self) -> bool {
        let mut turns = self.lock();
        while turns.count == TURN.get() && !turns.is_over {
            turns = self.changed.wait(turns).unwrap_or_else(PoisonError::into_inner);
        }
        TURN.set(turns.count);
        !turns.is_over
    }

    /// Counts this program among those that have begun the turn.
    pub(crate) fn has_begun(&self) {
        self.lock().begun += 1;
        self.changed.notify_all();
    }

    /// True while the turn of this thread goes on.
    pub(crate) fn is_open(&self) -> bool {
        let turns = self.lock();
        turns.count == TURN.get() && !turns.is_over
    }

    fn lock(&self) -> MutexGuard<'_, Turns> {
        self.turns.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
