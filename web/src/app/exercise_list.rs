//! What the page has of exercises.

use exercises::{Attempt, Exercise};

/// The exercises, the chosen one, and the attempt at it.
#[derive(Default)]
pub(super) struct Exercises {
    pub(super) is_open: bool,
    /// Those that ship, and those that were opened from files. Empty until they are first shown.
    pub(super) all: Vec<Exercise>,
    pub(super) chosen: usize,
    pub(super) attempt: Option<Attempt>,
    pub(super) shown_hints: usize,
}

impl Exercises {
    pub(super) fn exercise(&self) -> Option<&Exercise> {
        self.all.get(self.chosen)
    }

    /// Chooses an exercise, which is not begun.
    pub(super) fn choose(&mut self, index: usize) {
        (self.chosen, self.attempt, self.shown_hints) = (index, None, 0);
    }

    /// Another arm: what was reached with the last one does not count.
    pub(super) fn end(&mut self) {
        self.attempt = None;
    }
}
