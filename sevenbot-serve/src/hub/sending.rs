//! Sends the queued requests over the line: stops first, then the frames of the hub itself, then the client whose turn it is.

use protocol_core::registers::Map;
use protocol_core::registers::map::{OFFSET, SPEED};
use protocol_core::report_kind::ReportKind;
use protocol_core::time::Instant;

use super::Hub;
use super::client::Waiting;
use super::client_id::ClientId;
use super::intent::Intent;
use super::line::Owner;
use super::own_registers::covers;
use super::request::{WholeRequest, read_bytes, without_idle_ends};
use super::shares::Shares;
use super::watchdog::ClientWatchdog;

impl Hub {
    /// Sends urgent requests, and what the hub needs to hold the arm. They wait for no other frame.
    pub(super) fn send_urgent(&mut self, now: Instant) {
        let ids: Vec<ClientId> = self.clients.keys().copied().collect();
        for id in ids {
            while let Some(waiting) = self.clients.get_mut(&id).and_then(|client| client.urgent.pop_front()) {
                self.send_request(now, id, waiting);
            }
        }
        self.send_hold(now);
    }

    /// Sends the next request or sample. Returns false if none can be sent now.
    pub(super) fn send_next(&mut self, now: Instant) -> bool {
        self.drop_stale(now);
        if self.sampler.begins_to_wait(now) {
            self.sampler.share.join(self.floor());
        }
        let sendable = self.clients.iter().filter(|(_, client)| self.line.takes(client));
        let sampler = self.sampler.next_due(now).map(|stream| {
            let bytes = read_bytes(stream.registers().1);
            (Shares::order(self.sampler.share, bytes), None, Some(stream))
        });
        let clients =
            sendable.map(|(&id, client)| (Shares::order(client.share, client.next_bytes()), Some(id), None));
        let next = clients.chain(sampler).min_by_key(|&(order, ..)| order);
        match next {
            Some((_, Some(id), _)) => {
                let waiting = self.clients.get_mut(&id).and_then(|client| client.waiting.pop_front());
                waiting.into_iter().for_each(|waiting| self.send_request(now, id, waiting));
                self.news.insert(id);
            }
            Some((_, _, Some(stream))) => self.send_sample(now, stream),
            _ => return false,
        }
        true
    }

    /// The tag at which a client that was idle joins those that wait: [`Shares::floor`].
    pub(super) fn floor(&self) -> u64 {
        let waiting = self.clients.values().filter(|client| !client.waiting.is_empty());
        self.shares.floor(waiting.map(|client| client.share))
    }

    /// Drops the requests to move or switch the arm that have waited for `LONGEST_WAIT`.
    fn drop_stale(&mut self, now: Instant) {
        for (&id, client) in &mut self.clients {
            if client.drop_stale(now) {
                self.news.insert(id);
            }
        }
    }

    fn send_request(&mut self, now: Instant, id: ClientId, Waiting { request, intent, .. }: Waiting) {
        let Some(client) = self.clients.get_mut(&id) else { return };
        self.shares.charge(&mut client.share, request.line_bytes());
        self.watchdog.sent_request(now, id);
        match request {
            WholeRequest::Read { address, count } => {
                let others = self.take_equal_reads(now, id, address, count);
                self.send_read(now, id, others, address, count);
            }
            WholeRequest::Write { map, address, values } => {
                self.send_write(now, id, intent, map, address, values);
            }
            WholeRequest::WritesBetweenReads { map, writes, read: (first, count) } => {
                self.send_read(now, id, Vec::new(), first, count);
                for (start, bytes) in writes {
                    self.send_write(now, id, intent, map, start, bytes);
                }
                self.send_read(now, id, Vec::new(), first, count);
            }
        }
    }

    /// Takes the reads of the same registers that are next in the queues of other clients: one reply answers all of them. Many
    /// programs poll the positions. A read of the offsets is not shared, because their form depends on the client.
    fn take_equal_reads(&mut self, now: Instant, id: ClientId, address: u8, count: u8) -> Vec<ClientId> {
        let mut others = Vec::new();
        if covers(&OFFSET, address, count.into()) {
            return others;
        }
        for (&other, client) in self.clients.iter_mut().filter(|(other, _)| **other != id) {
            if client.waits_to_read(address, count) {
                client.waiting.pop_front();
                client.unanswered += 1;
                self.watchdog.sent_request(now, other);
                others.push(other);
            }
        }
        self.news.extend(&others);
        others
    }

    /// Sends a read of a client, whose reply is for `others`, too.
    fn send_read(&mut self, now: Instant, id: ClientId, others: Vec<ClientId>, address: u8, count: u8) {
        let Some(client) = self.clients.get_mut(&id) else { return };
        client.unanswered += 1;
        // A write of 0 registers chooses the form of the offsets (M5).
        let form = client.own.form_of_read(address, count, self.known.form_before_writes());
        if let Some(map) = form.filter(|_| !self.options.is_read_only) {
            self.line.send_write(now, map, 0, &[]);
        }
        let clients = std::iter::once(id).chain(others).collect();
        self.line.send_clients_read(now, clients, address, count);
    }

    fn send_write(
        &mut self,
        now: Instant,
        id: ClientId,
        intent: Intent,
        map: Map,
        address: u8,
        mut values: Vec<u8>,
    ) {
        let Some(client) = self.clients.get_mut(&id) else { return };
        let is_accepted = self.known.accepts(map, address, &values);
        if is_accepted && client.own.write(map, address, &mut values) {
            client.schedule.set(now, &client.own);
            self.set_frequencies(now);
        }
        if !self.options.is_read_only {
            self.note_targets(intent, map, address, &values);
            if covers(&SPEED, address, values.len()) {
                self.line.cancel_reads(Owner::Speeds);
            }
            self.known.write(map, address, &values);
            if is_accepted && map == Map::V22 {
                let damps = self.known.watchdog_damps();
                self.watchdog.wrote(now, id, damps, address, &values);
                ClientWatchdog::for_arm(address, &mut values);
            }
            let (start, bytes) = without_idle_ends(address, &values);
            self.line.send_write(now, map, start, bytes);
        }
    }

    /// Notes which joints a write to the arm holds or moves.
    pub(super) fn note_targets(&mut self, intent: Intent, map: Map, address: u8, values: &[u8]) {
        let targets = self.known.targets_in(map, address, values);
        self.held.note_write(intent, &targets);
        if let Some(hold) = self.hold.as_mut().filter(|_| intent.holds()) {
            hold.note_held(&targets);
        }
    }

    pub(super) fn set_frequencies(&mut self, now: Instant) {
        self.sampler.set_frequencies(now, self.clients.values().map(|client| &client.own));
    }

    fn send_sample(&mut self, now: Instant, stream: ReportKind) {
        let (address, count) = stream.registers();
        self.shares.charge(&mut self.sampler.share, read_bytes(count));
        self.sampler.note_sent(now, stream);
        self.line.send_read(now, Owner::Sample(stream), address, count);
    }
}
