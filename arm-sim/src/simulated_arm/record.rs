//! Records the session of an arm: see [`crate::session`].

use alloc::boxed::Box;

use protocol_core::time::Instant;

use super::SimulatedArm;
use crate::action::Action;
use crate::session::{Entry, SessionEvent, SessionRecorder};
use crate::tap::Watcher;

impl<F, B, C> SimulatedArm<F, B, C> {
    /// Passes the inputs of the arm, and the bytes that the host takes, to `recorder` from now on. Changes by
    /// [`SimulatedArm::plant_mut`] are not recorded: use [`SimulatedArm::act`].
    pub fn set_recorder(&mut self, recorder: impl SessionRecorder + 'static) {
        self.recorder = Watcher::holding(Box::new(recorder));
    }

    pub(super) fn record_advance(&mut self, now: Instant, host_is_idle: bool) {
        self.record(now, |_| SessionEvent::Advanced(host_is_idle));
    }

    pub(super) fn record_sent(&mut self, bytes: &[u8]) {
        self.record(self.now, |_| SessionEvent::Sent(bytes.to_vec()));
    }

    pub(super) fn record_taken(&mut self, count: usize) {
        self.record(self.now, |arm| {
            SessionEvent::Taken(arm.to_host.arrived().iter().copied().take(count).collect())
        });
    }

    pub(super) fn record_action(&mut self, now: Instant, action: Action) {
        self.record(now, |_| SessionEvent::Acted(action));
    }

    fn record(&mut self, now: Instant, event: impl FnOnce(&Self) -> SessionEvent) {
        if self.recorder.is_empty() {
            return;
        }
        let entry = Entry { now, event: event(self) };
        self.recorder.get().into_iter().for_each(|recorder| recorder.add(&entry));
    }
}
