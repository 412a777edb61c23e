//! The next message for each connection.

use protocol_core::time::Instant;
use serde::Serialize;

use super::{ClassInfo, Classroom, RefusedTab, TabConnection};
use crate::connection::ConnectionId;
use crate::message::{ClassNews, LentArm, StopNews, ToPupil, ToTeacher};

impl Classroom {
    /// The connections for which a message is due.
    pub fn ready(&self, now: Instant) -> impl Iterator<Item = ConnectionId> {
        let has_message = move |connection: &TabConnection| match connection {
            TabConnection::Stranger { .. } => false,
            TabConnection::Pupil(number) => {
                self.pupils.get(number).is_some_and(|pupil| pupil.has_message(now, self.message.0))
            }
            TabConnection::Teacher(desk) => desk.has_message(now, self.change),
            TabConnection::Refused(why) => why.is_some(),
        };
        self.connections.iter().filter(move |(_, connection)| has_message(connection)).map(|(&id, _)| id)
    }

    /// The next message for a connection, in JSON: the most urgent one; `None` if none is due.
    pub fn next_message(&mut self, now: Instant, id: ConnectionId) -> Option<String> {
        let mut connection = self.connections.remove(&id)?;
        let message = match &mut connection {
            TabConnection::Stranger { .. } => None,
            TabConnection::Pupil(number) => self.for_pupil(now, *number),
            TabConnection::Teacher(desk) => desk
                .next_message(now, self.change, || self.welcome(), || ToTeacher::Class(self.class(now)))
                .as_ref()
                .and_then(json),
            TabConnection::Refused(why) => why.take().and_then(|why| match why {
                RefusedTab::Pupil(why) => json(&ToPupil::Refused(why)),
                RefusedTab::Teacher => json(&ToTeacher::Full),
            }),
        };
        self.connections.insert(id, connection);
        message
    }

    /// True if no more message is due for the connection, and it has to be closed. Also for an unknown connection.
    #[must_use]
    pub fn is_over(&self, id: ConnectionId) -> bool {
        matches!(self.connections.get(&id), None | Some(TabConnection::Refused(None)))
    }

    fn for_pupil(&mut self, now: Instant, number: u32) -> Option<String> {
        let lease = self.lease_now();
        let holder = lease.and_then(|lease| self.pupils.get(&lease.pupil)).map(|pupil| pupil.name.clone());
        let lent = || {
            let (lease, holder) = lease.zip(holder)?;
            Some(LentArm { holder, seconds: lease.seconds(now), is_yours: lease.pupil == number })
        };
        let message = (self.message.0, self.message.1.as_str());
        self.pupils.get_mut(&number)?.next_message(now, message, lent).as_ref().and_then(json)
    }

    fn welcome(&self) -> ToTeacher {
        let ClassInfo { addresses, code, has_arm } = self.info.clone();
        ToTeacher::Welcome { addresses, code, has_arm }
    }

    fn class(&self, now: Instant) -> ClassNews {
        let stop = self.stop.map(|stop| stop.number);
        let tiles = self.pupils.iter().map(|(&number, pupil)| pupil.tile(now, number, stop));
        let arm = self.arm.as_ref().map(|arm| arm.tile(now));
        let text = self.message.1.clone();
        ClassNews { pupils: tiles.collect(), stop: self.stop_news(), arm, text }
    }

    fn stop_news(&self) -> Option<StopNews> {
        let stop = self.stop?;
        let of_pupils = self.pupils.values().filter_map(|pupil| pupil.stop);
        let of_pupils = of_pupils.filter(|pending| pending.number == stop.number).map(|it| it.tile());
        Some(stop.news(of_pupils.chain(self.arm.as_ref().and_then(|arm| arm.stop))))
    }
}

fn json(message: &impl Serialize) -> Option<String> {
    serde_json::to_string(message).ok()
}
