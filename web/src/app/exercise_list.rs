//! The state of the page for exercises.

use exercises::{Attempt, Exercise};

/// The exercises, the chosen one, and the attempt at it.
#[derive(Default)]
pub(super) struct Exercises {
    pub(super) is_open: bool,
    /// The shipped exercises, and those that were opened from files. Empty until they are first shown.
    pub(super) all: Vec<Exercise>,
    pub(super) chosen: usize,
    pub(super) attempt: Option<Attempt>,
    pub(super) shown_hints: usize,
}

impl Exercises {
    pub(super) fn exercise(&self) -> Option<&Exercise> {
        self.all.get(self.chosen)
    }

    /// Chooses an exercise by its index in `all`, without an attempt.
    pub(super) fn choose(&mut self, index: usize) {
        (self.chosen, self.attempt, self.shown_hints) = (index, None, 0);
    }

    /// Ends the attempt, because the page changes to another arm.
    pub(super) fn end(&mut self) {
        self.attempt = None;
    }
}
