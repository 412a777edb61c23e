//! `sevenbot serve` with a low limit of file descriptors.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use system_tests::read_request;
use system_tests::registers::DEVICE_CODE;
use system_tests::wait::wait_until;

use super::served::{Served, exchange, simulator};

/// The most file descriptors that the server may have open.
const DESCRIPTORS: usize = 64;
/// Connections of each kind. All kinds together exceed the limit.
const CONNECTIONS: usize = 60;

#[test]
fn connections_leave_file_descriptors_for_the_arm() {
    let mut served = Served::start_with_descriptors(DESCRIPTORS, 1);
    let mut program = served.connect();
    exchange(&mut program, &read_request(DEVICE_CODE, 1), &system_tests::frames::reply(DEVICE_CODE, &[7]));
    let over_tcp: Vec<_> = (0..CONNECTIONS).map(|_| served.connect()).collect();
    let before_the_handshake: Vec<_> = (0..CONNECTIONS).map(|_| served.connect_web()).collect();
    let socket = served.local_socket();
    let at_the_socket: Vec<_> = (0..CONNECTIONS).map(|_| UnixStream::connect(&socket)).collect();
    served.simulator.kill();
    served.simulator = simulator(served.folder.path());
    program.set_read_timeout(Some(Duration::from_millis(500))).expect("a timeout");
    wait_until("the arm answers again", || {
        program.write_all(&read_request(DEVICE_CODE, 1)).expect("the server takes bytes");
        program.read_exact(&mut [0; 8]).is_ok()
    });
    drop((over_tcp, before_the_handshake, at_the_socket));
    wait_until("another program has a place", || {
        let mut next = served.connect();
        next.set_read_timeout(Some(Duration::from_secs(5))).expect("a timeout");
        next.write_all(&read_request(DEVICE_CODE, 1)).is_ok() && next.read_exact(&mut [0; 8]).is_ok()
    });
}
