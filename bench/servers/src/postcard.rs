//! postcard and cobs: requests and replies are Rust types, serialised by postcard with a CRC-16 behind them and
//! stuffed by cobs, so that a zero ends a frame and stands nowhere else; stream and registers are the caller's.

use crc::{CRC_16_MODBUS, Crc};
use postcard::de_flavors::crc::from_bytes_u16;
use postcard::ser_flavors::crc::to_slice_u16;
use serde::{Deserialize, Serialize, Serializer};

use crate::Server;
use crate::inbox::Inbox;
use crate::work::initial_values;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// Longer than any frame: 255 values, what is said about them, CRC, and what stuffing adds.
const ROOM: usize = 272;

/// What can be asked.
#[derive(Deserialize)]
enum Request<'a> {
    Read { address: u8, count: u8 },
    Write { address: u8, values: &'a [u8] },
}

/// What is answered.
#[derive(Serialize)]
struct Reply<'a> {
    address: u8,
    #[serde(serialize_with = "at_once")]
    values: &'a [u8],
}

/// Bytes as bytes: a slice goes value by value otherwise.
fn at_once<S: Serializer>(values: &&[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(values)
}

/// The peers postcard and cobs.
pub struct PostcardServer {
    inbox: Inbox,
    /// So many bytes in the inbox are not the end of a frame.
    searched: usize,
    work: Work,
}

/// The registers, and room for a frame without and with its stuffing.
struct Work {
    registers: [u8; 256],
    plain: [u8; ROOM],
    stuffed: [u8; ROOM],
    carried_out: usize,
}

impl Default for PostcardServer {
    /// A server that was sent nothing yet.
    fn default() -> Self {
        let (plain, stuffed) = ([0; ROOM], [0; ROOM]);
        let work = Work { registers: initial_values(), plain, stuffed, carried_out: 0 };
        Self { inbox: Inbox::new(), searched: 0, work }
    }
}

impl Server for PostcardServer {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        self.inbox.push(piece);
        while let Some(length) = self.frame_length() {
            let frame = self.inbox.bytes().get(..length).unwrap_or(&[]);
            // A frame that is none is skipped, up to the zero behind it.
            let _ = self.work.answer(frame, reply);
            self.inbox.take(length + 1);
        }
    }

    /// Nothing waits for a silence: a zero is the only end of a frame.
    fn end(&mut self, _: &mut impl FnMut(&[u8])) {}

    fn carried_out(&self) -> usize {
        self.work.carried_out
    }
}

impl PostcardServer {
    /// How long the first frame is without its zero, once that has come.
    fn frame_length(&mut self) -> Option<usize> {
        let bytes = self.inbox.bytes();
        let found = bytes.iter().skip(self.searched).position(|&byte| byte == 0);
        let length = found.map(|place| self.searched + place);
        self.searched = if length.is_some() { 0 } else { bytes.len() };
        length
    }
}

impl Work {
    /// Carries a request out, and hands out the reply to a read. `None`: it is no request.
    fn answer(&mut self, frame: &[u8], reply: &mut impl FnMut(&[u8])) -> Option<()> {
        let report = cobs::decode(frame, &mut self.plain).ok()?;
        let plain = self.plain.get(..report.frame_size())?;
        match from_bytes_u16(plain, CRC.digest()).ok()? {
            Request::Read { address, count } => {
                let first = usize::from(address);
                let values = self.registers.get(first..first + usize::from(count))?;
                let plain = to_slice_u16(&Reply { address, values }, &mut self.plain, CRC.digest()).ok()?;
                let length = cobs::try_encode(plain, &mut self.stuffed).ok()?;
                *self.stuffed.get_mut(length)? = 0;
                reply(self.stuffed.get(..=length)?);
            }
            Request::Write { address, values } => {
                let first = usize::from(address);
                self.registers.get_mut(first..first + values.len())?.copy_from_slice(values);
            }
        }
        self.carried_out += 1;
        Some(())
    }
}
