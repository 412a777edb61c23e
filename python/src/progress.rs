//! The progress of a long call on a terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget};

/// Calls of [`ProgressLine::show`] until the bar appears, so that short calls show nothing.
const DELAY_CALLS: u32 = 10;
const REDRAW_HZ: u8 = 10;

/// A progress bar on the standard error, if that is a terminal.
#[derive(Default)]
pub(crate) struct ProgressLine {
    calls: u32,
    bar: Option<ProgressBar>,
}

impl ProgressLine {
    /// Shows how much of a call is done. `total` is 0 while it is unknown. The caller calls this each 50 ms.
    pub(crate) fn show(&mut self, done: u64, total: u64) {
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
        bar.set_position(done);
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}
