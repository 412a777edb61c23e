//! The peer `modbus-core`. It determines the length of a frame, checks and decodes it, and encodes the reply. The
//! stream and the registers are implemented here.
//!
//! Its own stream decoder, `rtu::decode`, finds no write of several registers: it takes the high byte of the
//! quantity for the byte count (version 0.2.0, `request_pdu_len`). So the loop over the bytes is here, with the same
//! two calls in the same order, and the length of that one request is determined here.

use modbus_core::rtu::server::encode_response;
use modbus_core::rtu::{self, DecodedFrame, Header, ResponseAdu};
use modbus_core::{Data, Error, Exception, ExceptionResponse, FunctionCode, Request, Response, ResponsePdu};

use crate::Server;
use crate::inbox::Inbox;
use crate::work::{REGISTERS, STATION, initial_words};

/// A Modbus RTU server with functions 3 and 16.
pub struct ModbusCoreServer {
    inbox: Inbox,
    registers: ModbusRegisters,
    executed: usize,
}

/// The registers, and buffers for the values read and for the reply: created once instead of once per request.
struct ModbusRegisters {
    words: [u16; REGISTERS],
    data: [u8; 250],
    frame: [u8; rtu::MAX_FRAME_LEN],
}

/// Bytes of a frame outside its PDU: station and CRC.
const ENVELOPE: usize = 3;
const WRITE_MULTIPLE_REGISTERS: u8 = 0x10;

impl Default for ModbusCoreServer {
    fn default() -> Self {
        let registers =
            ModbusRegisters { words: initial_words(), data: [0; 250], frame: [0; rtu::MAX_FRAME_LEN] };
        Self { inbox: Inbox::new(), registers, executed: 0 }
    }
}

impl ModbusCoreServer {
    /// Parses one request at the front. Returns `false` if it needs more bytes.
    fn answer_one(&mut self, reply: &mut impl FnMut(&[u8])) -> bool {
        let bytes = self.inbox.bytes();
        let frame = match pdu_length(bytes).and_then(|length| match length {
            Some(length) => Ok(rtu::extract_frame(bytes, length)?.map(|frame| (frame, length))),
            None => Ok(None),
        }) {
            Ok(Some(frame)) => frame,
            Ok(None) => return false,
            Err(_) => {
                self.inbox.take(1);
                return true;
            }
        };
        let (DecodedFrame { slave, pdu }, length) = frame;
        if slave == STATION
            && let Ok(request) = Request::try_from(pdu)
        {
            self.executed += usize::from(self.registers.answer(request, reply));
        }
        self.inbox.take(length + ENVELOPE);
        true
    }
}

/// The length of a request's PDU, or `None` if too few bytes have arrived.
fn pdu_length(bytes: &[u8]) -> Result<Option<usize>, Error> {
    match bytes {
        [_, WRITE_MULTIPLE_REGISTERS, rest @ ..] => Ok(rest.get(4).map(|&count| 6 + usize::from(count))),
        _ => rtu::request_pdu_len(bytes),
    }
}

impl Server for ModbusCoreServer {
    fn feed(&mut self, piece: &[u8], reply: &mut impl FnMut(&[u8])) {
        self.inbox.push(piece);
        while self.answer_one(reply) {}
    }

    fn end(&mut self, reply: &mut impl FnMut(&[u8])) {
        while !self.inbox.bytes().is_empty() {
            if !self.answer_one(reply) {
                self.inbox.take(1);
            }
        }
    }

    fn executed(&self) -> usize {
        self.executed
    }
}

impl ModbusRegisters {
    /// Executes a request, and passes the reply to `reply`. Returns `true` if the request was executed.
    fn answer(&mut self, request: Request<'_>, reply: &mut impl FnMut(&[u8])) -> bool {
        let result = execute(&mut self.words, request, &mut self.data);
        let executed = result.is_ok();
        let function = FunctionCode::from(request);
        let pdu = ResponsePdu(result.map_err(|exception| ExceptionResponse { function, exception }));
        let response = ResponseAdu { hdr: Header { slave: STATION }, pdu };
        if let Ok(length) = encode_response(response, &mut self.frame) {
            reply(self.frame.get(..length).unwrap_or(&[]));
        }
        executed
    }
}

fn execute<'data>(
    registers: &mut [u16],
    request: Request<'_>,
    data: &'data mut [u8],
) -> Result<Response<'data>, Exception> {
    match request {
        Request::ReadHoldingRegisters(first, count) => {
            let first = usize::from(first);
            let words =
                registers.get(first..first + usize::from(count)).ok_or(Exception::IllegalDataAddress)?;
            let data = Data::from_words(words, data).map_err(|_| Exception::IllegalDataValue)?;
            Ok(Response::ReadHoldingRegisters(data))
        }
        Request::WriteMultipleRegisters(first, words) => {
            let start = usize::from(first);
            let targets =
                registers.get_mut(start..start + words.len()).ok_or(Exception::IllegalDataAddress)?;
            for (target, word) in targets.iter_mut().zip(words) {
                *target = word;
            }
            let count = u16::try_from(words.len()).map_err(|_| Exception::IllegalDataValue)?;
            Ok(Response::WriteMultipleRegisters(first, count))
        }
        _ => Err(Exception::IllegalFunction),
    }
}
