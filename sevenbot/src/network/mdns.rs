//! Names of arms on the local network: multicast DNS, service `_sevenbot._tcp`.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use mdns_sd::{IfKind, ServiceDaemon, ServiceEvent, ServiceInfo};

use super::address::Address;
use super::known_names::KnownName;

/// The service type under which servers announce their arms.
const SERVICE: &str = "_sevenbot._tcp.local.";
/// The property of a server with TLS.
const ENCRYPTED: (&str, &str) = ("tls", "1");
/// How long to wait for answers.
const ANSWER_TIME: Duration = Duration::from_millis(1_500);

/// An arm that a server of the network announces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Announced {
    /// The name of the server, as in `sevenbot://NAME`.
    pub name: String,
    /// Its address over TCP: of IPv4 if it has one that is no loopback address.
    pub address: SocketAddr,
    /// Does the server require TLS?
    pub is_encrypted: bool,
}

impl From<Announced> for KnownName {
    fn from(arm: Announced) -> Self {
        let Announced { name, address, is_encrypted } = arm;
        let address = address.to_string();
        Self { name, address: if is_encrypted { Address::Tls(address) } else { Address::Tcp(address) } }
    }
}

/// Why a name is not announced.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct AnnounceError(#[from] mdns_sd::Error);

/// A name that is announced. Dropping it ends the announcement.
pub struct Announcement {
    daemon: ServiceDaemon,
    name: String,
}

impl Announcement {
    /// Announces a server that listens on a TCP port, at all addresses of this computer if `address` is unspecified; for 0.0.0.0
    /// only those of IPv4. `is_encrypted`: with TLS.
    ///
    /// # Errors
    /// The system has no multicast, or the name is not fit for it.
    pub fn new(name: &str, address: SocketAddr, is_encrypted: bool) -> Result<Self, AnnounceError> {
        let daemon = ServiceDaemon::new()?;
        if address.is_ipv4() {
            // The server does not listen at the addresses of IPv6.
            daemon.disable_interface(IfKind::IPv6)?;
        }
        let host = format!("sevenbot-{name}.local.");
        let listed = if address.ip().is_unspecified() { String::new() } else { address.ip().to_string() };
        let properties: &[(&str, &str)] = if is_encrypted { &[ENCRYPTED] } else { &[] };
        let service = ServiceInfo::new(SERVICE, name, &host, listed.as_str(), address.port(), properties)?;
        let service = if listed.is_empty() { service.enable_addr_auto() } else { service };
        let full_name = service.get_fullname().to_owned();
        daemon.register(service)?;
        Ok(Self { daemon, name: full_name })
    }
}

impl std::fmt::Debug for Announcement {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("Announcement").field(&self.name).finish()
    }
}

impl Drop for Announcement {
    fn drop(&mut self) {
        // Tell others at once that the name is gone.
        if let Ok(done) = self.daemon.unregister(&self.name) {
            let _ = done.recv_timeout(Duration::from_millis(200));
        }
        let _ = self.daemon.shutdown();
    }
}

/// The arms that are announced now. Asks the network for a second and a half.
#[must_use]
pub fn announced() -> Vec<Announced> {
    let mut found = Vec::new();
    let _ = browse(|arm| {
        found.push(arm);
        false
    });
    found.sort_by(|one: &Announced, other| one.name.cmp(&other.name));
    found.dedup();
    found
}

/// The announced arm of this name; `None` if no arm of this name answers within a second and a half.
#[must_use]
pub fn find(name: &str) -> Option<Announced> {
    let mut found = None;
    let _ = browse(|arm| {
        let is_wanted = arm.name == name;
        if is_wanted {
            found = Some(arm);
        }
        is_wanted
    });
    found
}

/// Calls `on_arm` with each arm that answers, until it returns true or the time is over.
fn browse(mut on_arm: impl FnMut(Announced) -> bool) -> Result<(), mdns_sd::Error> {
    let daemon = ServiceDaemon::new()?;
    let events = daemon.browse(SERVICE)?;
    let end = Instant::now() + ANSWER_TIME;
    while let Ok(event) = events.recv_deadline(end) {
        let ServiceEvent::ServiceResolved(service) = event else { continue };
        let name =
            service.fullname.strip_suffix(SERVICE).unwrap_or_default().trim_end_matches('.').to_owned();
        // Prefer IPv4, because an IPv6 address may need a scope. Take a loopback address last: every computer has it.
        let addresses = service.addresses.iter().map(mdns_sd::ScopedIp::to_ip_addr);
        let Some(address) = addresses.min_by_key(|ip| (ip.is_loopback(), *ip)) else { continue };
        let is_encrypted = service.txt_properties.get_property_val_str(ENCRYPTED.0) == Some(ENCRYPTED.1);
        if on_arm(Announced { name, address: SocketAddr::new(address, service.port), is_encrypted }) {
            break;
        }
    }
    let _ = daemon.shutdown();
    Ok(())
}
