//! Queues or drops each request of a client. A stop also drops the motion that waits, and ends the streams of the other
//! clients.

use host_link::sharing::SharingCommand;
use protocol_core::time::Instant;

use super::Hub;
use super::client::{LONGEST_WAIT, MOST_WAITING, Waiting};
use super::client_id::ClientId;
use super::drive::MayNotMove;
use super::intent::Intent;
use super::request::WholeRequest;

/// The result of handing over a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// The request waits for its turn, or the hub holds the arm in its place.
    Queued,
    /// The request is dropped: too many requests of the client wait already, or the client has left.
    NoRoom,
    /// No arm answers: the request is dropped. A read of the server's own registers still gets a reply, and a stop is still
    /// sent to an arm that fell silent.
    NoArm,
    /// The server is read-only: the request waits for its turn, and then writes only the client's own registers.
    ReadOnly,
    /// The request is dropped: another client stopped the arm, and this one has not started anew.
    Stopped,
    /// The request is dropped: another client drives.
    AnotherDrives,
    /// The request is dropped: it may have been sent [`LONGEST_WAIT`] ago or earlier.
    Late,
}

impl Hub {
    /// Takes a request of a client, which was sent at `since` or later. A stop is carried out with the next [`Hub::poll`],
    /// before everything else; of a flood of stops only the first ones are.
    pub fn request(
        &mut self,
        now: Instant,
        id: ClientId,
        since: Instant,
        request: WholeRequest,
    ) -> Admission {
        let Some(client) = self.clients.get_mut(&id).filter(|client| client.has_room()) else {
            return Admission::NoRoom;
        };
        let (intent, command) = client.meaning(now, &request, &self.known);
        if !self.has_arm() {
            return self.request_without_arm(now, id, request, intent, command);
        }
        if self.options.is_read_only {
            self.queue(now, id, Waiting { request, intent: Intent::Setting, since });
            return if intent.is_some() { Admission::ReadOnly } else { Admission::Queued };
        }
        if let Some(command) = command {
            self.obey(now, id, command);
        }
        let intent = intent.unwrap_or(Intent::Setting);
        if let Err(reason) = self.check_motion(now, id, intent) {
            return reason;
        }
        if intent.must_be_fresh() && now - since >= LONGEST_WAIT {
            return self.refuse_late(now, id, intent);
        }
        if intent.ends_streams() {
            self.stop(now, id);
        }
        self.queue(now, id, Waiting { request, intent, since });
        Admission::Queued
    }

    /// Stops the arm for a client, as 1 in register 239 does, also an arm that fell silent. [`Hub::hold_outcome`] has the
    /// outcome. Does nothing if no arm was found since the port was opened, or if the server is read-only.
    pub fn stop_arm(&mut self, now: Instant, id: ClientId) -> Admission {
        if !self.has_arm() && !self.is_silent() {
            return Admission::NoArm;
        }
        if self.options.is_read_only {
            return Admission::ReadOnly;
        }
        self.obey(now, id, SharingCommand::Stop);
        Admission::Queued
    }

    /// Would a stop drop this request of a client if it waited in the queue?
    #[must_use]
    pub fn moves_arm(&self, now: Instant, id: ClientId, request: &WholeRequest) -> bool {
        let meaning = self.clients.get(&id).map(|client| client.meaning(now, request, &self.known));
        meaning.and_then(|(intent, _)| intent).is_some_and(Intent::is_ended_by_stop)
    }

    /// Handles a request while no arm answers. A silent arm may still receive frames, so it is stopped, or its motors are
    /// switched off, if the request asks for that.
    fn request_without_arm(
        &mut self,
        now: Instant,
        id: ClientId,
        request: WholeRequest,
        intent: Option<Intent>,
        command: Option<SharingCommand>,
    ) -> Admission {
        let may_hear = self.is_silent() && !self.options.is_read_only;
        match intent.filter(|_| may_hear) {
            Some(intent @ Intent::MotorsOff) => {
                self.stop(now, id);
                self.queue(now, id, Waiting { request, intent, since: now });
                return Admission::Queued;
            }
            Some(Intent::Stop | Intent::Hold) => self.obey(now, id, SharingCommand::Stop),
            Some(_) if command == Some(SharingCommand::Stop) => self.obey(now, id, SharingCommand::Stop),
            _ => {}
        }
        self.answer_without_arm(now, id, &request);
        Admission::NoArm
    }

    /// Answers a request while there is no arm: a read of the server's own registers gets a reply if the client has room for it,
    /// all others are refused.
    fn answer_without_arm(&mut self, now: Instant, id: ClientId, request: &WholeRequest) {
        let reply = self.own_reply(now, id, request);
        let Some(client) = self.clients.get_mut(&id) else { return };
        match reply {
            Some(reply) if client.events.len() < MOST_WAITING => client.events.push_back(reply),
            _ => client.refuse(request),
        }
        self.news.insert(id);
    }

    /// Drops a request that comes too late. The targets of a late stop or hold would move the arm, so the hub holds the arm
    /// itself.
    fn refuse_late(&mut self, now: Instant, id: ClientId, intent: Intent) -> Admission {
        if intent.is_urgent() {
            self.obey(now, id, SharingCommand::Stop);
            return Admission::Queued;
        }
        if let Some(client) = self.clients.get_mut(&id) {
            client.dropped = client.dropped.wrapping_add(1);
        }
        Admission::Late
    }

    fn queue(&mut self, now: Instant, id: ClientId, waiting: Waiting) {
        let floor = self.floor();
        let Some(client) = self.clients.get_mut(&id) else { return };
        if client.waiting.is_empty() {
            client.share.join(floor);
        }
        client.queue(now, waiting);
    }

    /// Checks whether the client may send a write with this intent now. If it may, and the write moves or switches
    /// something, the client drives. If it may not, counts the write as dropped.
    fn check_motion(&mut self, now: Instant, id: ClientId, intent: Intent) -> Result<(), Admission> {
        let Some(client) = self.clients.get_mut(&id).filter(|_| intent.is_ended_by_stop()) else {
            return Ok(());
        };
        self.driver.check(now, id, &mut client.driving).map_err(|reason| {
            client.dropped = client.dropped.wrapping_add(1);
            match reason {
                MayNotMove::Stopped => Admission::Stopped,
                MayNotMove::AnotherDrives => Admission::AnotherDrives,
            }
        })
    }

    /// Notes that a client stops the arm: drops the waiting motion of all clients, and ends the streams of the others.
    fn stop(&mut self, now: Instant, by: ClientId) {
        self.stops = self.stops.wrapping_add(1);
        self.driver.end(None);
        for (&id, client) in &mut self.clients {
            if client.drop_motion() {
                self.news.insert(id);
            }
            if id == by {
                client.driving.start_anew();
            } else {
                client.driving.stop(now);
            }
        }
    }

    /// Carries out a command in register 239.
    fn obey(&mut self, now: Instant, id: ClientId, command: SharingCommand) {
        match command {
            SharingCommand::Stop => {
                self.stop(now, id);
                self.start_hold();
            }
            SharingCommand::StartAnew => {
                if let Some(client) = self.clients.get_mut(&id) {
                    client.driving.start_anew();
                }
            }
            SharingCommand::HandOver => self.driver.end(Some(id)),
        }
    }
}
