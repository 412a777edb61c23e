//! One question at a time to the servos, with retries, and without echoes and late answers.
//!
//! Every question is a read, also where others send a ping: the echo of a ping has the same bytes as the answer of a
//! servo that reports a wrong voltage, and the echo of a read never has the length of its answer.

use std::fmt;
use std::time::Duration;

use motion_core::servo_bus::frame::{self, Decoder, Frame, FrameBuffer, Instruction};

use tracing::trace;

use super::error::ServoError;
use super::servo_line::ServoLine;
use crate::error::{OpenError, ReceiveCounts};
use crate::open_port::OpenPort;

/// The line is at rest once nothing came for so long: longer than the latency timer of an FTDI chip, 16 ms.
const IDLE_TIME: Duration = Duration::from_millis(25);

/// How to talk to servos.
#[derive(Clone, Copy, Debug)]
pub struct BusOptions {
    /// How long to wait for one answer.
    pub reply_timeout: Duration,
    /// How often to ask before giving up, at least once.
    pub attempts: u32,
}

impl Default for BusOptions {
    fn default() -> Self {
        Self { reply_timeout: Duration::from_millis(200), attempts: 3 }
    }
}

/// What a servo answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoReply {
    /// Its error bits: [`motion_core::servo_bus::frame::error`].
    pub errors: u8,
    /// The values of the registers that were read.
    pub values: Vec<u8>,
}

/// The servo bus, of which this is the only master.
pub struct BusMaster {
    line: Box<dyn ServoLine>,
    options: BusOptions,
    decoder: Decoder,
    /// What came and the decoder has not taken yet.
    waiting: Vec<u8>,
    has_echo: bool,
    received: ReceiveCounts,
    /// Servos whose answers came when another one was asked.
    late: Vec<u8>,
}

impl fmt::Debug for BusMaster {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("BusMaster").field("options", &self.options).finish_non_exhaustive()
    }
}

impl BusMaster {
    /// Opens the port of an adapter. Nothing is sent yet.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn open(path: &str, baud: u32, options: BusOptions) -> Result<Self, OpenError> {
        Ok(Self::with_line(Box::new(OpenPort::open(path, baud)?), options))
    }

    /// The bus behind any line.
    #[must_use]
    pub fn with_line(line: Box<dyn ServoLine>, options: BusOptions) -> Self {
        Self {
            line,
            options,
            decoder: Decoder::new(),
            waiting: Vec::new(),
            has_echo: false,
            received: ReceiveCounts::default(),
            late: Vec::new(),
        }
    }

    /// Was an echo of a question received? An adapter that joins TX and RX gives one to every question.
    #[must_use]
    pub const fn has_echo(&self) -> bool {
        self.has_echo
    }

    /// How it talks to servos.
    #[must_use]
    pub const fn options(&self) -> BusOptions {
        self.options
    }

    /// The time since some instant in the past.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.line.now()
    }

    /// Talks at another baud rate from now on. What is still on its way is dropped.
    ///
    /// # Errors
    /// The adapter does not know the rate.
    pub fn set_baud(&mut self, baud: u32) -> Result<(), ServoError> {
        self.line.set_baud(baud)?;
        self.wait_for_silence(Duration::ZERO)?;
        self.late.clear();
        Ok(())
    }

    /// The values of `count` registers of a servo, all of one instant.
    ///
    /// # Errors
    /// The servo does not answer, or the port is gone.
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
        // A late answer must not be taken for that to the next question.
        self.wait_for_silence(IDLE_TIME)?;
        Err(no_answer)
    }

    /// Writes registers and reads them back, several times if need be. An acknowledgement proves nothing and a servo
    /// may be set to give none (its register 8), so only the reading counts.
    ///
    /// # Errors
    /// The servo does not answer or does not hold the values, or the port is gone.
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

    /// Writes registers and does not look whether that worked.
    ///
    /// # Errors
    /// The port is gone.
    pub fn send_write(&mut self, id: u8, register: u8, values: &[u8]) -> Result<(), ServoError> {
        let mut request = FrameBuffer::new();
        frame::write(&mut request, id, register, values);
        // An acknowledgement ends the wait; where a servo gives none, this is the time it needs to take the values.
        self.exchange(&request, IDLE_TIME, |answer| answer.id == id && answer.params.is_empty()).map(drop)
    }

    /// Asks once. `None`: no answer in time.
    pub(crate) fn try_read(
        &mut self,
        id: u8,
        register: u8,
        count: u8,
        timeout: Duration,
    ) -> Result<Option<ServoReply>, ServoError> {
        // The question for two registers has the length of its answer, so three are read.
        let asked = if count == 2 { 3 } else { count };
        let mut request = FrameBuffer::new();
        frame::read(&mut request, id, register, asked);
        let is_answer = |frame: &Frame<'_>| frame.id == id && frame.params.len() == usize::from(asked);
        let answer = self.exchange(&request, timeout, is_answer)?;
        Ok(answer.map(|mut answer| {
            answer.values.truncate(usize::from(count));
            answer
        }))
    }

    /// How many more answers with this id come within `timeout`: more than none means several servos with one id.
    pub(crate) fn extra_answers(&mut self, id: u8, timeout: Duration) -> Result<usize, ServoError> {
        self.late.clear();
        self.wait_for_silence(timeout)?;
        Ok(self.late.iter().filter(|&&late| late == id).count())
    }

    /// The servos whose answers came too late, since this was last asked.
    pub(crate) fn take_late(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.late)
    }

    /// How many damaged frames were received since this was last asked.
    pub(crate) fn take_damaged(&mut self) -> usize {
        std::mem::take(&mut self.received.damaged_frames)
    }

    /// Waits until nothing came for `silence`. Frames that came meanwhile are late answers.
    pub(crate) fn wait_for_silence(&mut self, silence: Duration) -> Result<(), ServoError> {
        loop {
            self.find_answer(&[], |_| false);
            if !self.receive(silence)? {
                self.decoder.clear();
                return Ok(());
            }
        }
    }

    /// Sends a frame, and waits for the answer to it.
    fn exchange(
        &mut self,
        request: &[u8],
        timeout: Duration,
        is_answer: impl Fn(&Frame<'_>) -> bool,
    ) -> Result<Option<ServoReply>, ServoError> {
        self.wait_for_silence(Duration::ZERO)?;
        trace!("-> {request:02x?}");
        self.line.send(request)?;
        let deadline = self.line.now() + timeout;
        loop {
            let has_more = self.receive(deadline.saturating_sub(self.line.now()))?;
            let answer = self.find_answer(request, &is_answer);
            if answer.is_some() || (!has_more && self.line.now() >= deadline) {
                return Ok(answer);
            }
        }
    }

    /// Takes what comes within `timeout`; `false` if nothing did.
    fn receive(&mut self, timeout: Duration) -> Result<bool, ServoError> {
        let bytes = self.line.receive(timeout)?;
        if !bytes.is_empty() {
            trace!("<- {bytes:02x?}");
        }
        self.received.bytes += bytes.len();
        self.waiting.extend(&bytes);
        Ok(!bytes.is_empty())
    }

    /// Looks for the answer among the bytes that are here. What stands behind it is kept.
    fn find_answer(&mut self, request: &[u8], is_answer: impl Fn(&Frame<'_>) -> bool) -> Option<ServoReply> {
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
            // As much as the decoder has room for besides what it holds.
            let piece: Vec<u8> = self.waiting.drain(..self.waiting.len().min(frame::MAX_FRAME)).collect();
            self.decoder.push(&piece);
        }
    }
}

/// Is this frame an echo: the one that was sent, or an earlier question that comes late? No answer is expected that
/// has two values.
fn is_echo(frame: &Frame<'_>, request: &[u8]) -> bool {
    if let [_, _, id, _, code, params @ .., _] = request
        && (frame.id, frame.code, frame.params) == (*id, *code, params)
    {
        return true;
    }
    frame.code == Instruction::Read as u8 && frame.params.len() == 2
}
