//! What the page has of exercises.

use exercises::{Attempt, Exercise, shipped};

/// The exercises, the chosen one, and the attempt at it.
pub(super) struct Exercises {
    pub(super) is_open: bool,
    /// Those that ship, and those that were opened from files.
    pub(super) all: Vec<Exercise>,
    pub(super) chosen: usize,
    pub(super) attempt: Option<Attempt>,
    pub(super) shown_hints: usize,
}

impl Default for Exercises {
    fn default() -> Self {
        Self { is_open: false, all: shipped(), chosen: 0, attempt: None, shown_hints: 0 }
    }
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
