//! A client that sends arbitrary bytes to the arm. The methods that parse frames panic at a byte outside a frame and at an
//! invalid checksum.

use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use serialport::{ClearBuffer, SerialPort};

use crate::frames::{read_request, with_checksum, write_request};
use crate::wait::{TIMEOUT, wait_for};

/// A reply, or a report of map 2.2, which has the same form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReplyFrame {
    /// The address of the first register.
    pub address: u8,
    /// One byte for each register from `address` on.
    pub values: Vec<u8>,
}

/// A serial port with an arm behind it.
pub struct ArmClient {
    port: Box<dyn SerialPort>,
}

impl ArmClient {
    /// Opens a port, and waits while it cannot be opened, for example because another program has it open.
    #[must_use]
    pub fn open(path: &Path, baud: u32) -> Self {
        let name = path.to_str().expect("port names are UTF-8");
        let open = || serialport::new(name, baud).timeout(TIMEOUT).open().map_err(|error| error.to_string());
        Self { port: wait_for(name, open) }
    }

    /// Sends bytes, which need not form a frame.
    pub fn send(&mut self, bytes: &[u8]) {
        self.port.write_all(bytes).expect("the port takes bytes");
    }

    /// Sends bytes in another thread, so that the test can read while the line is full.
    pub fn send_in_background(&mut self, bytes: Vec<u8>) -> thread::JoinHandle<()> {
        let mut port = self.port.try_clone().expect("a second handle on the port");
        thread::spawn(move || port.write_all(&bytes).expect("the port takes bytes"))
    }

    /// Sends a write request. It has no reply (D6).
    pub fn write(&mut self, address: u8, values: &[u8]) {
        self.send(&write_request(address, values));
    }

    /// Sends a read request and returns the values of its reply. Skips reports before it.
    #[track_caller]
    pub fn read(&mut self, address: u8, count: u8) -> Vec<u8> {
        self.send(&read_request(address, count));
        self.values(address, count)
    }

    /// Sends a write and a read at once, and returns the values of the reply: the state directly after the write.
    #[track_caller]
    pub fn write_and_read(&mut self, (address, values): (u8, &[u8]), (first, count): (u8, u8)) -> Vec<u8> {
        self.send(&[write_request(address, values), read_request(first, count)].concat());
        self.values(first, count)
    }

    #[track_caller]
    fn values(&mut self, address: u8, count: u8) -> Vec<u8> {
        let deadline = Instant::now() + TIMEOUT;
        while Instant::now() < deadline {
            if let Some(reply) = self.reply_within(TIMEOUT)
                && reply.address == address
                && reply.values.len() == usize::from(count)
            {
                return reply.values;
            }
        }
        panic!("no reply to a read of {count} registers at {address}");
    }

    /// Reads one register.
    #[track_caller]
    pub fn register(&mut self, address: u8) -> u8 {
        self.read(address, 1)[0]
    }

    /// The value of a 16-bit counter; `address` is the register of its low byte.
    #[track_caller]
    pub fn counter(&mut self, address: u8) -> u16 {
        let bytes = self.read(address, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    }

    /// Reads like [`ArmClient::read`]. `None` if no frame begins within `timeout`, or the next frame is not the reply.
    #[track_caller]
    pub fn try_read(&mut self, address: u8, count: u8, timeout: Duration) -> Option<Vec<u8>> {
        self.send(&read_request(address, count));
        let reply = self.reply_within(timeout)?;
        (reply.address == address && reply.values.len() == usize::from(count)).then_some(reply.values)
    }

    /// The next reply or report of map 2.2; `None` if none begins within `timeout`.
    #[track_caller]
    pub fn reply_within(&mut self, timeout: Duration) -> Option<ReplyFrame> {
        let frame = self.frame_within(timeout)?;
        assert_eq!(frame[2], 0x03, "a byte from the arm outside a reply");
        let count = usize::from(frame[4]);
        Some(ReplyFrame { address: frame[3], values: frame[5..5 + count].to_vec() })
    }

    /// The bytes of the next frame of any function; `None` if none begins within `timeout`.
    #[track_caller]
    pub fn frame_within(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        let mut frame = vec![0; 5];
        if !self.begin(&mut frame[..1], timeout) {
            return None;
        }
        self.fill(&mut frame[1..]);
        assert_eq!(frame[..2], [0xAA, 0x77], "a byte from the arm outside a frame");
        assert!(matches!(frame[2], 0x03 | 0x05 | 0x08), "the arm does not send function {}", frame[2]);
        // An alarm has no count.
        let count = if frame[2] == 0x08 { 0 } else { usize::from(frame[4]) };
        frame.resize(5 + count + 2, 0);
        self.fill(&mut frame[5..]);
        assert_eq!(frame, with_checksum(&frame[..5 + count]), "an invalid checksum from the arm");
        Some(frame)
    }

    /// The next reply or report of map 2.2. Panics if none begins within [`TIMEOUT`].
    #[track_caller]
    pub fn reply(&mut self) -> ReplyFrame {
        self.reply_within(TIMEOUT).expect("a frame from the arm")
    }

    /// Checks that the next bytes are these.
    #[track_caller]
    pub fn expect(&mut self, bytes: &[u8]) {
        let mut received = vec![0; bytes.len()];
        self.fill(&mut received);
        assert_eq!(received, bytes);
    }

    /// Checks that no reply is pending. Replies have the order of their requests (D5), so a pending one would come before
    /// the reply to this request.
    #[track_caller]
    pub fn expect_nothing_more(&mut self) {
        // A reply without values equals its request.
        let empty_read = read_request(0, 0);
        self.send(&empty_read);
        self.expect(&empty_read);
    }

    /// Drops received bytes until the line is silent for 200 ms.
    pub fn drain(&mut self) {
        loop {
            self.port.clear(ClearBuffer::Input).expect("the port can be cleared");
            thread::sleep(Duration::from_millis(200));
            if self.port.bytes_to_read().expect("the port is there") == 0 {
                return;
            }
        }
    }

    fn begin(&mut self, byte: &mut [u8], timeout: Duration) -> bool {
        self.port.set_timeout(timeout).expect("a timeout");
        let has_begun = match self.port.read(byte) {
            Ok(length) => length == 1,
            Err(error) if error.kind() == ErrorKind::TimedOut => false,
            Err(error) => panic!("the port is gone: {error}"),
        };
        self.port.set_timeout(TIMEOUT).expect("a timeout");
        has_begun
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
