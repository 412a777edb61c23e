//! A client of the arm at the level of bytes: sends what it is given, and takes nothing back but frames.
//!
//! Strict on purpose: whatever the arm sends has to be an answer frame with a right checksum, from its
//! first byte to its last.

use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use serialport::{ClearBuffer, SerialPort};

use crate::frames::{read_request, sealed, write_request};

/// Patience with an arm on a busy machine. It costs nothing while all is well.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// An answer, or a report sent unasked: the frames look the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// The first register.
    pub address: u8,
    /// The values from there on.
    pub values: Vec<u8>,
}

/// A serial port with an arm behind it.
pub struct Line {
    port: Box<dyn SerialPort>,
}

impl Line {
    /// Opens a port, as soon as its last user has let go of it.
    #[must_use]
    pub fn open(path: &Path, baud: u32) -> Self {
        let name = path.to_str().expect("port names are UTF-8");
        let deadline = Instant::now() + PATIENCE;
        loop {
            match serialport::new(name, baud).timeout(PATIENCE).open() {
                Ok(port) => return Self { port },
                Err(error) if Instant::now() > deadline => panic!("{name}: {error}"),
                Err(_) => thread::sleep(Duration::from_millis(20)),
            }
        }
    }

    /// Sends bytes, whatever they are.
    pub fn send(&mut self, bytes: &[u8]) {
        self.port.write_all(bytes).expect("the port takes bytes");
    }

    /// Sends bytes from another thread, for more of them than fit into the line while nobody reads.
    pub fn send_in_background(&mut self, bytes: Vec<u8>) -> thread::JoinHandle<()> {
        let mut port = self.port.try_clone().expect("a second handle on the port");
        thread::spawn(move || port.write_all(&bytes).expect("the port takes bytes"))
    }

    /// Sends a write request. There is no answer to it (D6).
    pub fn write(&mut self, address: u8, values: &[u8]) {
        self.send(&write_request(address, values));
    }

    /// Sends a read request and takes the answer, letting reports that come before it pass.
    #[track_caller]
    pub fn read(&mut self, address: u8, count: u8) -> Vec<u8> {
        self.send(&read_request(address, count));
        self.answer(address, count)
    }

    /// Sends a write and a read in one piece, and takes the answer: the arm's state directly after the write, however
    /// late this machine takes the answer.
    #[track_caller]
    pub fn write_and_read(&mut self, (address, values): (u8, &[u8]), (asked, count): (u8, u8)) -> Vec<u8> {
        self.send(&[write_request(address, values), read_request(asked, count)].concat());
        self.answer(asked, count)
    }

    #[track_caller]
    fn answer(&mut self, address: u8, count: u8) -> Vec<u8> {
        let deadline = Instant::now() + PATIENCE;
        while Instant::now() < deadline {
            match self.reply_within(PATIENCE) {
                Some(reply) if reply.address == address && reply.values.len() == usize::from(count) => {
                    return reply.values;
                }
                _ => {}
            }
        }
        panic!("no answer to a read of {count} registers at {address}");
    }

    /// The value of one register.
    #[track_caller]
    pub fn register(&mut self, address: u8) -> u8 {
        self.read(address, 1)[0]
    }

    /// The value of a counter of two registers.
    #[track_caller]
    pub fn counter(&mut self, address: u8) -> u16 {
        let bytes = self.read(address, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    }

    /// As [`Line::read`], but an arm that does not answer within `patience` is no failure.
    #[track_caller]
    pub fn try_read(&mut self, address: u8, count: u8, patience: Duration) -> Option<Vec<u8>> {
        self.send(&read_request(address, count));
        let reply = self.reply_within(patience)?;
        (reply.address == address && reply.values.len() == usize::from(count)).then_some(reply.values)
    }

    /// The next frame; `None` when none has begun within `patience`.
    #[track_caller]
    pub fn reply_within(&mut self, patience: Duration) -> Option<Reply> {
        let mut frame = vec![0; 5];
        if !self.begin(&mut frame[..1], patience) {
            return None;
        }
        self.fill(&mut frame[1..]);
        assert_eq!(frame[..3], [0xAA, 0x77, 0x03], "the arm sends answer frames and nothing else");
        let (address, count) = (frame[3], usize::from(frame[4]));
        frame.resize(5 + count + 2, 0);
        self.fill(&mut frame[5..]);
        assert_eq!(frame, sealed(&frame[..5 + count]), "a wrong checksum from the arm");
        Some(Reply { address, values: frame[5..5 + count].to_vec() })
    }

    /// The next frame; its absence is a failure.
    #[track_caller]
    pub fn reply(&mut self) -> Reply {
        self.reply_within(PATIENCE).expect("a frame from the arm")
    }

    /// Takes exactly these bytes from the line.
    #[track_caller]
    pub fn expect(&mut self, bytes: &[u8]) {
        let mut came = vec![0; bytes.len()];
        self.fill(&mut came);
        assert_eq!(came, bytes);
    }

    /// Makes sure that nothing is on its way: as answers keep the order of their requests (D5), whatever the
    /// arm still had to say would come before the answer to this one.
    #[track_caller]
    pub fn expect_nothing_more(&mut self) {
        let nothing = read_request(0, 0);
        self.send(&nothing);
        // With no values in it, the answer is the request.
        self.expect(&nothing);
    }

    /// Forgets what came so far, until nothing has come for a while.
    pub fn quieten(&mut self) {
        loop {
            self.port.clear(ClearBuffer::Input).expect("the port can be cleared");
            thread::sleep(Duration::from_millis(200));
            if self.port.bytes_to_read().expect("the port is there") == 0 {
                return;
            }
        }
    }

    fn begin(&mut self, byte: &mut [u8], patience: Duration) -> bool {
        self.port.set_timeout(patience).expect("a time-out");
        let begun = match self.port.read(byte) {
            Ok(length) => length == 1,
            Err(error) if error.kind() == ErrorKind::TimedOut => false,
            Err(error) => panic!("the port is gone: {error}"),
        };
        self.port.set_timeout(PATIENCE).expect("a time-out");
        begun
    }

    #[track_caller]
    fn fill(&mut self, bytes: &mut [u8]) {
        let mut filled = 0;
        while filled < bytes.len() {
            match self.port.read(&mut bytes[filled..]) {
                Ok(length) if length > 0 => filled += length,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                other => panic!("{other:?} after {:02x?}", &bytes[..filled]),
            }
        }
    }
}
