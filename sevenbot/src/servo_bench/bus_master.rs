//! Exchanges with one servo at a time: retries, echoes and late answers.
//!
//! Every question is a read, never a ping. The echo of a ping has the bytes of an answer with a voltage error. The echo
//! of a read never has the length of its answer.

use std::fmt;
use std::time::{Duration, Instant};

use motion_core::servo_bus::frame::{self, Decoder, Instruction, ServoFrame, ServoFrameBuffer};

use tracing::trace;

use super::error::ServoError;
use super::servo_line::ServoLine;
use crate::error::{OpenError, ReceiveCounts};
use crate::open_port::OpenPort;

/// The line is idle after this time without bytes: more than the latency timer of an FTDI chip, 16 ms.
const IDLE_TIME: Duration = Duration::from_millis(25);
/// Pause before each frame: a servo releases the line some microseconds after its last stop bit. A USB adapter pauses
/// longer anyway, but a UART on the bus may not.
const GUARD_TIME: Duration = Duration::from_micros(100);

/// How long to wait for the answer of a servo, and how often to ask.
#[derive(Clone, Copy, Debug)]
pub struct BusOptions {
    /// How long one attempt waits for the answer.
    pub reply_timeout: Duration,
    /// The number of attempts, at least one.
    pub attempts: u32,
}

impl Default for BusOptions {
    fn default() -> Self {
        Self { reply_timeout: Duration::from_millis(200), attempts: 3 }
    }
}

/// The answer of a servo to a read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoReply {
    /// The error bits: [`motion_core::servo_bus::frame::error`].
    pub errors: u8,
    /// The values of the registers that were read.
    pub values: Vec<u8>,
}

/// The master of a servo bus. A bus must have only one.
pub struct BusMaster {
    line: Box<dyn ServoLine>,
    start: Instant,
    options: BusOptions,
    decoder: Decoder,
    /// Received bytes that the decoder had no room for.
    waiting: Vec<u8>,
    has_echo: bool,
    received: ReceiveCounts,
    /// The ids of good frames that were neither an echo nor the answer waited for, such as answers after their timeout.
    late: Vec<u8>,
}

impl fmt::Debug for BusMaster {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("BusMaster").field("options", &self.options).finish_non_exhaustive()
    }
}

impl BusMaster {
    /// Opens the port of an adapter. Sends nothing.
    ///
    /// # Errors
    /// The port cannot be opened.
    pub fn open(path: &str, baud: u32, options: BusOptions) -> Result<Self, OpenError> {
        Ok(Self::with_line(Box::new(OpenPort::open(path, baud)?), options))
    }

    /// A master on a line that is open, such as a simulated one.
    #[must_use]
    pub fn with_line(line: Box<dyn ServoLine>, options: BusOptions) -> Self {
        Self {
            start: line.now(),
            line,
            options,
            decoder: Decoder::new(),
            waiting: Vec::new(),
            has_echo: false,
            received: ReceiveCounts::default(),
            late: Vec::new(),
        }
    }

    /// Was an echo received? An adapter that connects TX to RX echoes every frame.
    #[must_use]
    pub const fn has_echo(&self) -> bool {
        self.has_echo
    }

    /// The options with which the bus was opened.
    #[must_use]
    pub const fn options(&self) -> BusOptions {
        self.options
    }

    /// The time since the bus was opened.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.line.now().saturating_duration_since(self.start)
    }

    /// Changes the baud rate. Drops bytes that have not been read.
    ///
    /// # Errors
    /// The adapter does not support the rate, or the port failed.
    pub fn set_baud(&mut self, baud: u32) -> Result<(), ServoError> {
        self.line.set_baud(baud)?;
        self.wait_for_silence(Duration::ZERO)?;
        self.late.clear();
        Ok(())
    }

    /// The values of `count` registers of a servo at one instant.
    ///
    /// # Errors
    /// The servo does not answer, or the port failed.
    pub fn read(&mut self, id: u8, register: u8, count: u8) -> Result<ServoReply, ServoError> {
        self.received = ReceiveCounts::default();
        for _ in 0..self.options.attempts.max(1) {
            if let Some(answer) = self.try_read(id, register, count, self.options.reply_timeout)? {
                return Ok(answer);
            }
        }
        let BusOptions { attempts, reply_timeout: waited } = self.options;
        let no_answer =
            ServoError::NoAnswer { id, attempts: attempts.max(1), waited, received: self.received };
        // A late answer must not be taken for the answer to the next question.
        self.wait_for_silence(IDLE_TIME)?;
        Err(no_answer)
    }

    /// Writes registers and reads them back, with retries. Only the read counts: a servo may be set to acknowledge
    /// nothing (its register 8).
    ///
    /// # Errors
    /// The servo does not answer, does not hold the values, or the port failed.
    pub fn write(&mut self, id: u8, register: u8, values: &[u8]) -> Result<(), ServoError> {
        let count = u8::try_from(values.len()).unwrap_or(u8::MAX);
        for _ in 0..self.options.attempts.max(1) {
            self.send_write(id, register, values)?;
            if self.read(id, register, count)?.values == values {
                return Ok(());
            }
        }
        Err(ServoError::NotTaken { id, register })
    }

    /// Writes registers once, without reading them back. Waits up to 25 ms for the acknowledgement.
    ///
    /// # Errors
    /// The port failed.
    pub fn send_write(&mut self, id: u8, register: u8, values: &[u8]) -> Result<(), ServoError> {
        let mut request = ServoFrameBuffer::new();
        frame::write(&mut request, id, register, values);
        // Wait for the acknowledgement, or as long as a servo needs to take the values.
        self.exchange(&request, IDLE_TIME, |answer| answer.id == id && answer.params.is_empty()).map(drop)
    }

    /// Reads once. `None` if no answer arrives in time.
    pub(crate) fn try_read(
        &mut self,
        id: u8,
        register: u8,
        count: u8,
        timeout: Duration,
    ) -> Result<Option<ServoReply>, ServoError> {
        // The question for two registers is as long as its answer, so read three.
        let asked = if count == 2 { 3 } else { count };
        let mut request = ServoFrameBuffer::new();
        frame::read(&mut request, id, register, asked);
        let is_answer = |frame: &ServoFrame<'_>| frame.id == id && frame.params.len() == usize::from(asked);
        let answer = self.exchange(&request, timeout, is_answer)?;
        Ok(answer.map(|mut answer| {
            answer.values.truncate(usize::from(count));
            answer
        }))
    }

    /// Counts further answers of this id until no byte arrives for `timeout`. One or more means that several servos have the
    /// id, unless an earlier answer came after its timeout.
    pub(crate) fn extra_answers(&mut self, id: u8, timeout: Duration) -> Result<usize, ServoError> {
        self.late.clear();
        self.wait_for_silence(timeout)?;
        Ok(self.late.iter().filter(|&&late| late == id).count())
    }

    /// Takes the ids of late answers, oldest first.
    pub(crate) fn take_late(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.late)
    }

    /// The number of damaged frames since the last call, or since the last [`Self::read`] began.
    pub(crate) fn take_damaged(&mut self) -> usize {
        std::mem::take(&mut self.received.damaged_frames)
    }

    /// Waits until no byte arrives for `silence`. Frames that arrive meanwhile count as late answers, except echoes of questions.
    pub(crate) fn wait_for_silence(&mut self, silence: Duration) -> Result<(), ServoError> {
        loop {
            self.find_answer(&[], |_| false);
            if !self.receive(silence)? {
                self.decoder.clear();
                return Ok(());
            }
        }
    }

    /// Sends a frame and waits for its answer.
    fn exchange(
        &mut self,
        request: &[u8],
        timeout: Duration,
        is_answer: impl Fn(&ServoFrame<'_>) -> bool,
    ) -> Result<Option<ServoReply>, ServoError> {
        self.wait_for_silence(Duration::ZERO)?;
        trace!("-> {request:02x?}");
        self.line.sleep(GUARD_TIME);
        self.line.send(request)?;
        let deadline = self.now() + timeout;
        loop {
            let has_more = self.receive(deadline.saturating_sub(self.now()))?;
            let answer = self.find_answer(request, &is_answer);
            if answer.is_some() || (!has_more && self.now() >= deadline) {
                return Ok(answer);
            }
        }
    }

    /// Reads from the line; `false` if no byte arrives within `timeout`.
    fn receive(&mut self, timeout: Duration) -> Result<bool, ServoError> {
        let bytes = self.line.receive(timeout)?;
        if !bytes.is_empty() {
            trace!("<- {bytes:02x?}");
        }
        self.received.bytes += bytes.len();
        self.waiting.extend(&bytes);
        Ok(!bytes.is_empty())
    }

    /// Searches the received bytes for the answer. Keeps the bytes after it.
    fn find_answer(
        &mut self,
        request: &[u8],
        is_answer: impl Fn(&ServoFrame<'_>) -> bool,
    ) -> Option<ServoReply> {
        loop {
            while let Some(found) = self.decoder.pull() {
                match found {
                    Err(_) => self.received.damaged_frames += 1,
                    Ok(frame) if is_echo(&frame, request) => {
                        self.has_echo = true;
                        self.received.echoes += 1;
                    }
                    Ok(frame) if is_answer(&frame) => {
                        return Some(ServoReply { errors: frame.code, values: frame.params.to_vec() });
                    }
                    Ok(frame) => {
                        self.received.other_frames += 1;
                        self.late.push(frame.id);
                    }
                }
            }
            if self.waiting.is_empty() {
                return None;
            }
            // The decoder has room for one longest frame.
            let piece: Vec<u8> = self.waiting.drain(..self.waiting.len().min(frame::MAX_FRAME)).collect();
            self.decoder.push(&piece);
        }
    }
}

/// Is this frame an echo of the request or of an earlier question? A question has two values, and no expected answer has two.
fn is_echo(frame: &ServoFrame<'_>, request: &[u8]) -> bool {
    if let [_, _, id, _, code, params @ .., _] = request
        && (frame.id, frame.code, frame.params) == (*id, *code, params)
    {
        return true;
    }
    frame.code == Instruction::Read as u8 && frame.params.len() == 2
}
