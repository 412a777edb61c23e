//! The peer `mavlink`. Its reader finds frames in a stream; the registers are implemented here. MAVLink has no
//! message for a register map, so requests and replies travel in TUNNEL, its message for arbitrary bytes: function,
//! address, count, values.

use core::convert::Infallible;

use embedded_io::{ErrorType, Read};
use mavlink::dialects::common::{MavTunnelPayloadType, TUNNEL_DATA};
use mavlink::error::{MessageReadError, ParserError};
use mavlink::{Dialect, MAVLinkV2MessageRaw, MavHeader, MavlinkReader, MavlinkVersion, MessageData};

use crate::Server;
use crate::inbox::Inbox;
use crate::work::initial_values;

/// Function code of a read, as in this project's protocol.
const READ: u8 = 3;
/// Function code of a write, as in this project's protocol.
const WRITE: u8 = 6;
/// Zeros that complete an unfinished frame at the end of the stream.
const FILLER: [u8; 64] = [0; 64];
/// Repetitions of [`FILLER`] that exceed the longest frame (283 bytes).
const FILLERS: usize = 5;

/// The received bytes, as the source that the reader reads from.
struct ReceivedBytes(Inbox);

impl ErrorType for ReceivedBytes {
    type Error = Infallible;
}

impl Read for ReceivedBytes {
    fn read(&mut self, room: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = self.0.bytes();
        let count = bytes.len().min(room.len());
        if let (Some(room), Some(bytes)) = (room.get_mut(..count), bytes.get(..count)) {
            room.copy_from_slice(bytes);
        }
        self.0.take(count);
        Ok(count)
    }
}

/// A dialect with the one message in use: a full dialect would first have to look the message up.
struct Tunnel;

impl Dialect for Tunnel {
    type Message = TUNNEL_DATA;
    type EncodeError = Infallible;

    fn message_id(&self, _: &TUNNEL_DATA) -> u32 {
        TUNNEL_DATA::ID
    }

    fn extra_crc(&self, message_id: u32) -> Option<u8> {
        (message_id == TUNNEL_DATA::ID).then_some(TUNNEL_DATA::EXTRA_CRC)
    }

    fn decode(&self, version: MavlinkVersion, _: u32, payload: &[u8]) -> Result<TUNNEL_DATA, ParserError> {
        TUNNEL_DATA::deser(version, payload)
    }

    fn encode(
        &self,
        version: MavlinkVersion,
        message: &TUNNEL_DATA,
        payload: &mut [u8],
    ) -> Result<usize, Infallible> {
        Ok(message.ser(version, payload))
    }
}

/// A server that answers reads and writes in TUNNEL messages of MAVLink 2.
pub struct MavlinkServer {
    reader: MavlinkReader<ReceivedBytes>,
    registers: [u8; 256],
    /// Buffer for the reply, created once instead of once per request.
    data: TUNNEL_DATA,
    frame: MAVLinkV2MessageRaw,
    executed: usize,
}

impl Default for MavlinkServer {
    fn default() -> Self {
        Self {
            reader: MavlinkReader::new(ReceivedBytes(Inbox::new())),
            registers: initial_values(),
            data: empty(),
            frame: MAVLinkV2MessageRaw::new(),
            executed: 0,
        }
    }
}

/// A message without destination and payload.
const fn empty() -> TUNNEL_DATA {
    TUNNEL_DATA {
        payload_type: MavTunnelPayloadType::MAV_TUNNEL_PAYLOAD_TYPE_UNKNOWN,
        target_system: 0,
        target_component: 0,
        payload_length: 0,
        payload: [0; 128],
    }
}

impl MavlinkServer {
    /// Executes a request, and passes the reply to a read to `reply`. `None` if the message is not a valid request.
    fn answer(
        &mut self,
        from: MavHeader,
        request: &TUNNEL_DATA,
        reply: &mut impl FnMut(&[u8]),
    ) -> Option<()> {
        let data = request.payload.get(..usize::from(request.payload_length))?;
        let (&[function, address, count], written) = data.split_first_chunk()?;
        let (first, length) = (usize::from(address), usize::from(count));
        let registers = self.registers.get_mut(first..first + length)?;
        match function {
            READ => {
                self.data.target_system = from.system_id.to_le_bytes()[0];
                self.data.target_component = from.component_id;
                let (head, rest) = self.data.payload.split_first_chunk_mut()?;
                let (values, unused) = rest.split_at_mut_checked(length)?;
                *head = [READ, address, count];
                values.copy_from_slice(registers);
                // MAVLink 2 does not send the zeros at the end of a payload.
                unused.fill(0);
                self.data.payload_length = 3 + count;
                let header = MavHeader { system_id: 1, component_id: 1, sequence: 0 };
                self.frame.serialize_message_data(header, &self.data);
                reply(self.frame.raw_bytes());
            }
            WRITE if written.len() == length => registers.copy_from_slice(written),
            _ => return None,
        }
        self.executed += 1;
        Some(())
    }
}

impl Server for MavlinkServer {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        self.reader.get_mut().0.push(piece);
        loop {
            match self.reader.read_message_with_dialect(&Tunnel, MavlinkVersion::V2) {
                Ok((from, request)) => _ = self.answer(from, &request, reply),
                Err(MessageReadError::Parse { .. }) => {}
                // The received bytes are used up.
                Err(MessageReadError::Io) => return,
            }
        }
    }

    /// The reader has no timeout. Zeros complete an unfinished frame, and its checksum then fails.
    fn end(&mut self, reply: &mut impl FnMut(&[u8])) {
        for _ in 0..FILLERS {
            self.feed(&FILLER, reply);
        }
    }

    fn executed(&self) -> usize {
        self.executed
    }
}
