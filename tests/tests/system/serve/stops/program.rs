//! A program that reads registers one after the other, and one that streams targets.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::thread;
use std::time::Duration;

use system_tests::frames::with_checksum;
use system_tests::registers::TARGET_POSITION;
use system_tests::wait::TIMEOUT;
use system_tests::{read_request, write_request};

use super::gate::Gate;
use crate::serve::served::Served;

/// The token for connections over TCP and to the WebSocket.
pub(crate) const TOKEN: &str = "correct-horse";
/// A program that writes 2 to this register may drive again after a stop.
const COMMAND: u8 = 239;

pub(super) trait Wire: Read + Write + Send {}

impl<W: Read + Write + Send> Wire for W {}

/// A program that waits for the reply to each read before it sends the next one.
pub(crate) struct Program(pub(super) Box<dyn Wire>);

impl Program {
    /// Three programs: one on a pseudo-terminal, one at the Unix socket, one over TCP.
    pub(crate) fn of_each_kind(served: &Served) -> Vec<Self> {
        let terminal = Self::on_terminal(&served.folder.path().join("a"));
        vec![terminal, Self::over_unix(served), Self::over_tcp(served)]
    }

    pub(crate) fn on_terminal(path: &Path) -> Self {
        let terminal = serialport::new(path.to_str().expect("text"), 115_200).timeout(TIMEOUT).open();
        Self(Box::new(terminal.expect("a port")))
    }

    /// A program at the Unix socket.
    pub(crate) fn over_unix(served: &Served) -> Self {
        let local = UnixStream::connect(served.local_socket()).expect("a connection");
        local.set_read_timeout(Some(TIMEOUT)).expect("a timeout");
        Self(Box::new(local))
    }

    pub(crate) fn over_tcp(served: &Served) -> Self {
        Self(Box::new(log_in(served)))
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).expect("the server takes bytes");
    }

    /// Reads registers, checks the frame of the reply, and returns their values.
    #[track_caller]
    pub(crate) fn read(&mut self, address: u8, count: u8) -> Vec<u8> {
        self.send(&read_request(address, count));
        let mut frame = vec![0; 7 + usize::from(count)];
        self.0.read_exact(&mut frame).expect("a reply");
        let values = frame[5..frame.len() - 2].to_vec();
        let start = [&[0xAA, 0x77, 0x03, address, count], values.as_slice()].concat();
        assert_eq!(frame, with_checksum(&start));
        values
    }
}

/// Opens a TCP connection and sends the token.
pub(super) fn log_in(served: &Served) -> TcpStream {
    let mut stream = served.connect();
    stream.set_nodelay(true).expect("an option");
    stream.set_read_timeout(Some(TIMEOUT)).expect("a timeout");
    stream.write_all(format!("{TOKEN}\n").as_bytes()).expect("taken");
    stream
}

/// In each turn of the gate, asks to drive again after the last stop, and streams targets until the turn ends.
pub(crate) fn stream(program: &mut Program, gate: &Gate) {
    let mut goals = [40, 140].into_iter().cycle();
    while gate.wait() {
        let goal = goals.next().expect("a goal");
        program.send(&write_request(COMMAND, &[2]));
        // The reply shows that the server has received the command.
        program.read(TARGET_POSITION, 1);
        gate.has_begun();
        while gate.is_open() {
            program.send(&write_request(TARGET_POSITION, &[goal]));
            thread::sleep(Duration::from_millis(5));
        }
    }
}
