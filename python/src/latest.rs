//! Passes the actions of a program that does not wait to the thread of the port, and passes the counts and failures of this
//! thread back.

use std::sync::{Mutex, MutexGuard, PoisonError};

use sevenbot::FineAngle;
use sevenbot::fine::FineTargets;
use sevenbot::moves::MoveError;
use sevenbot::stream::LatestCounts;

/// The newest action of a program, and the counts and the failure of earlier ones.
#[derive(Debug, Default)]
pub(crate) struct LatestSlot(Mutex<LatestState>);

#[derive(Debug, Default)]
struct LatestState {
    is_open: bool,
    /// The newest action until the thread of the port takes it.
    action: Option<FineTargets>,
    /// Actions that newer ones replaced before the thread of the port took them.
    skipped: u32,
    /// The counts of the sender.
    counts: LatestCounts,
    failed: Option<MoveError>,
    /// The last angle that the program offered for each joint, or else its target at the start, in degrees.
    pose: [f64; 7],
}

impl LatestState {
    fn counts(&self) -> LatestCounts {
        LatestCounts { skipped: self.counts.skipped + self.skipped, ..self.counts }
    }
}

/// The answer to a program that offers an action.
pub(crate) struct Told {
    pub(crate) counts: LatestCounts,
    /// The last angle of each joint in the actions so far, or else its target at the start, in degrees.
    pub(crate) pose: [f64; 7],
}

impl LatestSlot {
    fn slot(&self) -> MutexGuard<'_, LatestState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens the slot for a stream that begins at this pose. Drops actions, counts and failures of an earlier stream.
    pub(crate) fn open(&self, pose: [f64; 7]) {
        *self.slot() = LatestState { is_open: true, pose, ..LatestState::default() };
    }

    /// Closes the slot at the end of a stream. The counts stay.
    pub(crate) fn close(&self) {
        self.slot().is_open = false;
    }

    /// Is the stream of this slot open?
    pub(crate) fn is_open(&self) -> bool {
        self.slot().is_open
    }

    /// Offers an action, which replaces one that still waits. `None`: no stream is open. After a failure it returns the failure,
    /// and drops the action.
    pub(crate) fn offer(&self, action: &FineTargets) -> Option<Result<Told, MoveError>> {
        let mut slot = self.slot();
        if !slot.is_open {
            return None;
        }
        if let Some(failed) = slot.failed.take() {
            return Some(Err(failed));
        }
        let mut newest = *action;
        if let Some(older) = slot.action {
            slot.skipped += 1;
            newest.iter_mut().zip(older).for_each(|(newer, older)| *newer = newer.or(older));
        }
        slot.action = Some(newest);
        for (degrees, angle) in slot.pose.iter_mut().zip(action) {
            *degrees = angle.map_or(*degrees, FineAngle::degrees);
        }
        Some(Ok(Told { counts: slot.counts(), pose: slot.pose }))
    }

    pub(crate) fn take(&self) -> Option<FineTargets> {
        self.slot().action.take()
    }

    pub(crate) fn waiting(&self) -> Option<FineTargets> {
        self.slot().action
    }

    /// Sets the counts and the failure that the program gets at its next action. An older failure stays if there is no new one.
    pub(crate) fn tell(&self, counts: LatestCounts, failed: Option<MoveError>) {
        let mut slot = self.slot();
        slot.counts = counts;
        slot.failed = failed.or(slot.failed.take());
    }

    /// Takes the failure that the program has not received yet.
    pub(crate) fn take_failure(&self) -> Option<MoveError> {
        self.slot().failed.take()
    }

    /// The counts of the sender so far.
    pub(crate) fn counts(&self) -> LatestCounts {
        self.slot().counts()
    }
}
