//! The progress of a long call on a terminal.

use std::sync::atomic::Ordering;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget};

use crate::worker::CallState;

/// Shorter calls show nothing.
const DELAY_CALLS: u32 = 10;
/// Redraws per second.
const REDRAW_HZ: u8 = 10;

/// A progress bar on the standard error, if that is a terminal.
#[derive(Default)]
pub(crate) struct ProgressLine {
    calls: u32,
    bar: Option<ProgressBar>,
}

impl ProgressLine {
    /// Shows the state of a call. Called each 50 ms.
    pub(crate) fn show(&mut self, state: &CallState) {
        let total = state.total.load(Ordering::Relaxed);
        self.calls = self.calls.saturating_add(1);
        if total == 0 || self.calls < DELAY_CALLS {
            return;
        }
        let target = || ProgressDrawTarget::stderr_with_hz(REDRAW_HZ);
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::with_draw_target(Some(total), target());
            bar.enable_steady_tick(Duration::from_secs(1));
            bar
        });
        bar.set_length(total);
        bar.set_position(state.done.load(Ordering::Relaxed));
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}
