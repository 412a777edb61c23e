//! Delivers replies from the line to the clients that asked, and replaces the values of the registers that the server keeps.

use host_link::sharing::{self, DrivenBy, SharingState};
use protocol_core::registers::map::{FAULTS, fault};
use protocol_core::time::Instant;

use super::Hub;
use super::client::{HubClient, HubEvent};
use super::client_id::ClientId;
use super::line::Owner;
use super::own_registers::byte_at;
use super::request::WholeRequest;

impl Hub {
    pub(super) fn deliver(&mut self, now: Instant, owner: Owner, event: HubEvent) {
        if matches!(event, HubEvent::Reply { .. }) {
            self.presence.hear(now);
        }
        match (owner, event) {
            (Owner::Client(id), mut event) => {
                if let HubEvent::Reply { address, values } = &mut event {
                    self.overlay(now, id, *address, values);
                }
                let Some(client) = self.clients.get_mut(&id) else { return };
                client.end_read(now, event);
                self.news.insert(id);
            }
            (Owner::Sample(stream), HubEvent::Reply { values, .. }) => {
                for (&id, client) in &mut self.clients {
                    if client.report(now, stream, &values) {
                        self.news.insert(id);
                    }
                }
            }
            (Owner::Hold, HubEvent::Reply { address, values }) => self.continue_hold(now, address, &values),
            (Owner::Speeds, HubEvent::Reply { values, .. }) => self.note_speeds(&values),
            (Owner::Identity, HubEvent::Reply { values, .. }) => self.identify(now, &values),
            (Owner::Presence, HubEvent::NoReply { .. }) if self.has_arm() && self.presence.miss() => {
                self.lose_arm(now);
            }
            // A hold reads again by itself.
            (Owner::Sample(_) | Owner::Identity | Owner::Presence | Owner::Hold | Owner::Speeds, _) => {}
        }
    }

    /// Overwrites the registers of a reply whose values the server keeps instead of the arm.
    fn overlay(&self, now: Instant, id: ClientId, address: u8, values: &mut [u8]) {
        if let Some(faults) = byte_at(address, values, &FAULTS).filter(|_| self.known.is_ours()) {
            *faults |= if self.watchdog.has_acted() { fault::HOST_SILENT } else { 0 };
        }
        self.watchdog.overlay(address, values);
        self.overlay_changed(address, values);
        if let Some(client) = self.clients.get(&id) {
            client.own.overlay(address, values);
            self.sharing_state(now, id, client).overlay(address, values);
        }
    }

    /// The reply to a read of the server's registers and no others: it needs no arm.
    pub(super) fn own_reply(&self, now: Instant, id: ClientId, request: &WholeRequest) -> Option<HubEvent> {
        let &WholeRequest::Read { address, count } = request else { return None };
        let client = self.clients.get(&id).filter(|client| client.can_receive)?;
        sharing::is_own(address, count).then(|| {
            let mut values = vec![0; count.into()];
            self.sharing_state(now, id, client).overlay(address, &mut values);
            HubEvent::Reply { address, values }
        })
    }

    /// The values of the server's registers for a client.
    fn sharing_state(&self, now: Instant, id: ClientId, client: &HubClient) -> SharingState {
        let clients = self.clients.values().filter(|client| client.left.is_none()).count();
        SharingState {
            clients: u8::try_from(clients).unwrap_or(u8::MAX),
            driven_by: match self.driver.at(now) {
                None => DrivenBy::Nobody,
                Some(driver) if driver == id => DrivenBy::This,
                Some(_) => DrivenBy::Another,
            },
            stops: self.stops,
            is_stopped: client.driving.is_stopped(now),
            is_read_only: self.options.is_read_only,
            has_one_driver: self.options.has_one_driver,
            is_without_arm: !self.has_arm(),
            dropped: client.dropped,
        }
    }
}
