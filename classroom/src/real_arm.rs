//! The class's real arm: who has it, and whether it has confirmed the last hold.

use protocol_core::time::Instant;

use crate::lease::Lease;
use crate::message::{ArmTile, NotGiven, StopOutcome, TileStop};
use crate::stop_all::PendingStop;

/// The state of the real arm, as the caller of the class sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ArmNews {
    /// It answers. Only then can a pupil get it.
    pub answers: bool,
    /// Requests may reach it, even if it does not answer.
    pub may_hear: bool,
    /// A hold is in progress.
    pub is_holding: bool,
    /// It has confirmed the last hold.
    pub holds: bool,
    /// Its motors were off or damped when it confirmed the hold.
    pub is_limp: bool,
}

/// The real arm of a class.
#[derive(Debug, Default)]
pub(crate) struct RealArm {
    news: ArmNews,
    hold: Option<PendingStop>,
    /// `Asked` from a stop for all until a hold is confirmed; then the outcome of the last confirmed hold. `None` before the
    /// first of either.
    pub(crate) stop: Option<TileStop>,
    lease: Option<Lease>,
    leases: u32,
}

impl RealArm {
    /// Requests that the arm holds its position.
    pub(crate) const fn hold(&mut self, now: Instant) {
        self.hold = Some(PendingStop::new(0, now));
    }

    /// Requests a hold because of a stop for all.
    pub(crate) const fn stop(&mut self, now: Instant) {
        self.stop = Some(TileStop::Asked);
        self.hold(now);
    }

    /// A lease that starts now. The arm is not lent yet.
    pub(crate) fn new_lease(&mut self, now: Instant, pupil: u32, seconds: u32) -> Result<Lease, NotGiven> {
        let lease = Lease::new(self.leases + 1, pupil, now, seconds).ok_or(NotGiven::BadTime)?;
        self.leases += 1;
        if self.news.answers { Ok(lease) } else { Err(NotGiven::ArmSilent) }
    }

    pub(crate) const fn lend(&mut self, lease: Lease) {
        self.lease = Some(lease);
    }

    pub(crate) const fn lease(&self) -> Option<Lease> {
        self.lease
    }

    /// Ends the lease, and requests a hold. Returns the pupil who had the arm.
    pub(crate) fn take_back(&mut self, now: Instant) -> Option<u32> {
        let lease = self.lease.take()?;
        self.hold(now);
        Some(lease.pupil)
    }

    /// True if a hold has to start now. The hold then counts as in progress.
    pub(crate) fn take_hold(&mut self, now: Instant) -> bool {
        let ArmNews { may_hear, is_holding, .. } = self.news;
        // A new stop does not wait for the end of an older one.
        let is_wanted =
            |hold: &&mut PendingStop| may_hear && hold.is_due(now) && !(is_holding && hold.was_sent);
        let Some(hold) = self.hold.as_mut().filter(is_wanted) else { return false };
        hold.sent(now);
        self.news = ArmNews { is_holding: true, holds: false, ..self.news };
        true
    }

    /// Takes news of the arm. Returns whether they differ from the known state, and whether they confirm the stop for all.
    pub(crate) fn take_news(&mut self, news: ArmNews) -> (bool, bool) {
        let is_new = self.news != news;
        self.news = news;
        // News from before the hold was sent do not confirm it.
        let Some(hold) = self.hold.as_mut().filter(|hold| is_new && news.holds && hold.was_sent) else {
            return (is_new, false);
        };
        let outcome = if news.is_limp { StopOutcome::Limp } else { StopOutcome::Holds };
        hold.confirm(0, outcome);
        (is_new, self.stop.replace(outcome.into()) == Some(TileStop::Asked))
    }

    pub(crate) fn tile(&self, now: Instant) -> ArmTile {
        ArmTile {
            answers: self.news.answers,
            stop: self.hold.map(|hold| hold.tile()),
            holder: self.lease.map(|lease| lease.pupil),
            seconds: self.lease.map_or(0, |lease| lease.seconds(now)),
        }
    }
}
