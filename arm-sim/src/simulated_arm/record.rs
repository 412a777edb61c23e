//! What is recorded of an arm: see [`crate::session`].

use alloc::boxed::Box;
use alloc::vec::Vec;

use protocol_core::time::Instant;

use super::SimulatedArm;
use crate::action::Action;
use crate::session::{Entry, Recorder, SessionEvent};
use crate::tap::Slot;

impl<F, B, C> SimulatedArm<F, B, C> {
    /// Passes everything that is done to the arm from outside, and the bytes that the host takes, to `recorder` from now
    /// on. What is done to the plant by [`SimulatedArm::plant_mut`] is not recorded: use [`SimulatedArm::act`].
    pub fn set_recorder(&mut self, recorder: impl Recorder + 'static) {
        self.recorder = Slot::holding(Box::new(recorder));
    }

    pub(super) fn record_sent(&mut self, idle_until: Instant, bytes: &[u8]) {
        let now = self.now;
        if let Some(recorder) = self.recorder.get() {
            recorder.add(&Entry { now, idle_until, event: SessionEvent::Sent(bytes.to_vec()) });
        }
    }

    /// The host is idle now.
    pub(super) fn record_idle(&mut self) {
        let now = self.now;
        if !self.is_host_idle
            && let Some(recorder) = self.recorder.get()
        {
            recorder.add(&Entry { now, idle_until: now, event: SessionEvent::Idle });
        }
    }

    pub(super) fn record_taken(&mut self, count: usize) {
        let (now, idle_until) = (self.now, self.idle_until);
        if let Some(recorder) = self.recorder.get() {
            let bytes: Vec<u8> = self.to_host.arrived().iter().copied().take(count).collect();
            recorder.add(&Entry { now, idle_until, event: SessionEvent::Taken(bytes) });
        }
    }

    pub(super) fn record_action(&mut self, now: Instant, action: Action) {
        let idle_until = self.idle_until;
        if let Some(recorder) = self.recorder.get() {
            recorder.add(&Entry { now, idle_until, event: SessionEvent::Acted(action) });
        }
    }
}
