//! A pupil: the connection of its tab, the last report, and the messages that are due.

use protocol_core::time::{Duration, Instant};

use crate::connection::ConnectionId;
use crate::message::{LeaseEnd, LentArm, StopOutcome, TabPresence, TabReport, Tile, ToPupil};
use crate::stop_all::PendingStop;

/// The shortest time between two questions to a tab. A change of the lease asks at once.
const ASK_PERIOD: Duration = Duration::from_millis(250);
/// A tab that does not answer is asked again after this time. The tab takes a silence of 10 s for a dead connection.
const ASK_AGAIN: Duration = Duration::from_millis(4_000);
/// A tab that has not answered for this long counts as silent.
const SILENT: Duration = Duration::from_millis(8_000);

#[derive(Debug)]
pub(crate) struct Pupil {
    pub(crate) name: String,
    pub(crate) key: String,
    /// `None`: the connection was lost at `lost`.
    pub(crate) connection: Option<ConnectionId>,
    lost: Instant,
    is_welcome_due: bool,
    report: Option<TabReport>,
    /// When the tab was asked last.
    asked: Instant,
    /// When the tab answered last, or joined.
    answered: Instant,
    is_ask_due: bool,
    waits_for_answer: bool,
    /// Why the lease of the pupil ended, until the tab is told.
    over: Option<LeaseEnd>,
    pub(crate) stop: Option<PendingStop>,
    /// The number of the last teacher's message that the tab got.
    message_seen: u32,
}

impl Pupil {
    pub(crate) const fn new(now: Instant, name: String, key: String, connection: ConnectionId) -> Self {
        Self {
            name,
            key,
            connection: Some(connection),
            lost: now,
            is_welcome_due: true,
            report: None,
            asked: now,
            answered: now,
            is_ask_due: true,
            waits_for_answer: false,
            over: None,
            stop: None,
            message_seen: 0,
        }
    }

    /// Moves the pupil to a new connection under this name, and makes all messages due again, except a confirmed stop. Returns the
    /// old connection if it is still open.
    pub(crate) fn rejoin(
        &mut self,
        now: Instant,
        name: String,
        connection: ConnectionId,
    ) -> Option<ConnectionId> {
        let before = self.connection.replace(connection);
        self.name = name;
        (self.is_welcome_due, self.is_ask_due, self.waits_for_answer) = (true, true, false);
        (self.answered, self.message_seen) = (now, 0);
        if let Some(stop) = &mut self.stop {
            stop.send_again(now);
        }
        before
    }

    /// Notes that the connection has ended.
    pub(crate) const fn lose(&mut self, now: Instant) {
        (self.connection, self.lost) = (None, now);
    }

    /// The time since the connection was lost; `None` while the tab is connected.
    pub(crate) fn lost_for(&self, now: Instant) -> Option<Duration> {
        self.connection.is_none().then(|| now - self.lost)
    }

    pub(crate) fn presence(&self, now: Instant) -> TabPresence {
        match self.connection {
            None => TabPresence::Lost,
            Some(_) if now - self.answered >= SILENT => TabPresence::Silent,
            Some(_) => TabPresence::Here,
        }
    }

    /// Makes a [`ToPupil::Ask`] due at once. It also tells who has the real arm.
    pub(crate) const fn ask(&mut self) {
        self.is_ask_due = true;
    }

    /// Records why the lease of the pupil ended.
    pub(crate) const fn end_lease(&mut self, why: LeaseEnd) {
        self.over = Some(why);
    }

    pub(crate) fn take_report(&mut self, now: Instant, report: TabReport) {
        (self.report, self.answered, self.waits_for_answer) = (Some(report), now, false);
    }

    pub(crate) fn confirm_stop(&mut self, number: u32, outcome: StopOutcome) -> bool {
        self.stop.as_mut().is_some_and(|stop| stop.confirm(number, outcome))
    }

    pub(crate) fn poll(&mut self, now: Instant) {
        let since = now - self.asked;
        self.is_ask_due |= since >= if self.waits_for_answer { ASK_AGAIN } else { ASK_PERIOD };
    }

    /// True if a message is due. `message` is the number of the teacher's last message.
    pub(crate) fn has_message(&self, now: Instant, message: u32) -> bool {
        let is_stop_due = self.stop.is_some_and(|stop| stop.is_due(now));
        is_stop_due || self.is_welcome_due || self.message_seen != message || self.is_ask_due
    }

    /// The next message for the tab: a stop before everything else.
    pub(crate) fn next_message(
        &mut self,
        now: Instant,
        (number, text): (u32, &str),
        arm: impl FnOnce() -> Option<LentArm>,
    ) -> Option<ToPupil> {
        if let Some(stop) = self.stop.as_mut().filter(|stop| stop.is_due(now)) {
            stop.sent(now);
            return Some(ToPupil::Stop { number: stop.number });
        }
        if std::mem::take(&mut self.is_welcome_due) {
            return Some(ToPupil::Welcome { name: self.name.clone(), key: self.key.clone() });
        }
        if self.message_seen != number {
            self.message_seen = number;
            return Some(ToPupil::Message { text: text.to_owned() });
        }
        std::mem::take(&mut self.is_ask_due).then(|| {
            (self.asked, self.waits_for_answer) = (now, true);
            ToPupil::Ask { arm: arm(), over: self.over.take() }
        })
    }

    pub(crate) fn tile(&self, now: Instant, pupil: u32, stop: Option<u32>) -> Tile {
        let pending = self.stop.filter(|pending| Some(pending.number) == stop);
        Tile {
            pupil,
            name: self.name.clone(),
            presence: self.presence(now),
            report: self.report.clone(),
            stop: pending.map(|pending| pending.tile()),
        }
    }
}
