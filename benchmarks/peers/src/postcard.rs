//! The peer `postcard` with `cobs`. Requests and replies are Rust types, serialised by postcard with a CRC-16 and
//! encoded by COBS, so that a zero marks the end of a frame and occurs nowhere else. The stream and the registers are
//! implemented here.

use crc::{CRC_16_MODBUS, Crc};
use postcard::de_flavors::crc::from_bytes_u16;
use postcard::ser_flavors::crc::to_slice_u16;
use serde::{Deserialize, Serialize, Serializer};

use crate::Server;
use crate::inbox::Inbox;
use crate::work::initial_values;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// Longer than any frame: 255 values, header, CRC and the bytes that COBS adds.
const ROOM: usize = 272;

#[derive(Deserialize)]
enum PostcardRequest<'a> {
    Read { address: u8, count: u8 },
    Write { address: u8, values: &'a [u8] },
}

/// The reply to a read.
#[derive(Serialize)]
struct PostcardReply<'a> {
    address: u8,
    #[serde(serialize_with = "as_bytes")]
    values: &'a [u8],
}

/// Serialises the values as one byte string: serde serialises a slice element by element.
fn as_bytes<S: Serializer>(values: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(values)
}

/// A server of postcard messages, with a CRC-16 and COBS.
pub struct PostcardServer {
    inbox: Inbox,
    /// The number of bytes at the front of the inbox that are known to hold no zero.
    searched: usize,
    server: RegisterServer,
}

/// The registers, and buffers for a frame before and after COBS encoding.
struct RegisterServer {
    registers: [u8; 256],
    plain: [u8; ROOM],
    stuffed: [u8; ROOM],
    executed: usize,
}

impl Default for PostcardServer {
    fn default() -> Self {
        let (plain, stuffed) = ([0; ROOM], [0; ROOM]);
        let server = RegisterServer { registers: initial_values(), plain, stuffed, executed: 0 };
        Self { inbox: Inbox::new(), searched: 0, server }
    }
}

impl Server for PostcardServer {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        self.inbox.push(piece);
        while let Some(length) = self.frame_length() {
            let frame = self.inbox.bytes().get(..length).unwrap_or(&[]);
            // An invalid frame is skipped, up to the zero that ends it.
            let _ = self.server.answer(frame, reply);
            self.inbox.take(length + 1);
        }
    }

    /// Does nothing: a frame ends with a zero, never with a timeout.
    fn end(&mut self, _: &mut impl FnMut(&[u8])) {}

    fn executed(&self) -> usize {
        self.server.executed
    }
}

impl PostcardServer {
    /// The length of the first frame without its zero, once the zero has arrived.
    fn frame_length(&mut self) -> Option<usize> {
        let bytes = self.inbox.bytes();
        let found = bytes.iter().skip(self.searched).position(|&byte| byte == 0);
        let length = found.map(|offset| self.searched + offset);
        self.searched = if length.is_some() { 0 } else { bytes.len() };
        length
    }
}

impl RegisterServer {
    /// Executes a request, and passes the reply to a read to `reply`. `None` if the frame is not a valid request.
    fn answer(&mut self, frame: &[u8], reply: &mut impl FnMut(&[u8])) -> Option<()> {
        let report = cobs::decode(frame, &mut self.plain).ok()?;
        let plain = self.plain.get(..report.frame_size())?;
        match from_bytes_u16(plain, CRC.digest()).ok()? {
            PostcardRequest::Read { address, count } => {
                let first = usize::from(address);
                let values = self.registers.get(first..first + usize::from(count))?;
                let plain =
                    to_slice_u16(&PostcardReply { address, values }, &mut self.plain, CRC.digest()).ok()?;
                let length = cobs::try_encode(plain, &mut self.stuffed).ok()?;
                *self.stuffed.get_mut(length)? = 0;
                reply(self.stuffed.get(..=length)?);
            }
            PostcardRequest::Write { address, values } => {
                let first = usize::from(address);
                self.registers.get_mut(first..first + values.len())?.copy_from_slice(values);
            }
        }
        self.executed += 1;
        Some(())
    }
}
