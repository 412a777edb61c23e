//! Checks whether this computer delivers multicast datagrams from one of its sockets to another.

use std::net::{Ipv4Addr, UdpSocket};
use std::time::Duration;

/// The group of multicast DNS.
const GROUP: Ipv4Addr = Ipv4Addr::new(224, 0, 0, 251);

/// Does a datagram to the group reach a socket of this computer that joined it?
#[must_use]
pub fn works() -> bool {
    let exchange = || {
        let receiver = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        receiver.join_multicast_v4(&GROUP, &Ipv4Addr::UNSPECIFIED)?;
        receiver.set_read_timeout(Some(Duration::from_secs(2)))?;
        let sender = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        sender.set_multicast_loop_v4(true)?;
        sender.send_to(b"7bot", (GROUP, receiver.local_addr()?.port()))?;
        receiver.recv(&mut [0; 4])
    };
    exchange().is_ok()
}
