//! One question at a time to the servos, with retries, and without echoes and late answers.
//!
//! Every question is a read, also where others send a ping: the echo of a ping has the same bytes as the answer of a
//! servo that reports a wrong voltage, and the echo of a read never has the length of its answer.

use std::fmt;
use std::time::Duration;

use motion_core::servo_bus::frame::{self, Decoder, Frame, FrameBuffer, Instruction};

use tracing::trace;

use super::error::ServoError;
use super::line::Line;
use crate::error::{Heard, OpenError};
use crate::serial::Serial;

/// The line is at rest once nothing came for so long: longer than the latency timer of an FTDI chip, 16 ms.
const AT_REST: Duration = Duration::from_millis(25);

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
pub struct Answer {
    /// Its error bits: [`motion_core::servo_bus::frame::error`].
    pub errors: u8,
    /// The values of the registers that were read.
    pub values: Vec<u8>,
}

/// The servo bus, of which this is the only master.
pub struct ServoBus {
    line: Box<dyn Line>,
    options: BusOptions,
    decoder: Decoder,
    /// What came and the decoder has not taken yet.
    waiting: Vec<u8>,
    has_echo: bool,
    heard: Heard,
    /// Servos whose answers came when another one was asked.
    late: Vec<u8>,
}

impl fmt::Debug for ServoBus {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("ServoBus").field("options", &self.options).finish_non_exhaustive()
    }
}

impl ServoBus {
    /// Opens the port of an adapter. Nothing is sent yet.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn open(path: &str, baud: u32, options: BusOptions) -> Result<Self, OpenError> {
        Ok(Self::over(Box::new(Serial::open(path, baud)?), options))
    }

    /// The bus behind any line.
    #[must_use]
    pub fn over(line: Box<dyn Line>, options: BusOptions) -> Self {
        Self {
            line,
            options,
            decoder: Decoder::new(),
            waiting: Vec::new(),
            has_echo: false,
            heard: Heard::default(),
            late: Vec::new(),
        }
    }

    /// Was an echo of a question heard? An adapter that joins TX and RX gives one to every question.
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
        self.rest(Duration::ZERO)?;
        self.late.clear();
        Ok(())
    }

    /// The values of `count` registers of a servo, all of one instant.
    ///
    /// # Errors
    /// The servo does not answer, or the port is gone.
    pub fn read(&mut self, id: u8, register: u8, count: u8) -> Result<Answer, ServoError> {
        self.heard = Heard::default();
        for _ in 0..self.options.attempts.max(1) {
            if let Some(answer) = self.ask(id, register, count, self.options.reply_timeout)? {
                return Ok(answer);
            }
        }
        let BusOptions { attempts, reply_timeout: waited } = self.options;
        let no_answer = ServoError::NoAnswer { id, attempts: attempts.max(1), waited, heard: self.heard };
        // A late answer must not be taken for that to the next question.
        self.rest(AT_REST)?;
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
        self.exchange(&request, AT_REST, |answer| answer.id == id && answer.params.is_empty()).map(drop)
    }

    /// Asks once. `None`: no answer in time.
    pub(crate) fn ask(
        &mut self,
        id: u8,
        register: u8,
        count: u8,
        patience: Duration,
    ) -> Result<Option<Answer>, ServoError> {
        // The question for two registers has the length of its answer, so three are read.
        let asked = if count == 2 { 3 } else { count };
        let mut request = FrameBuffer::new();
        frame::read(&mut request, id, register, asked);
        let is_answer = |frame: &Frame<'_>| frame.id == id && frame.params.len() == usize::from(asked);
        let answer = self.exchange(&request, patience, is_answer)?;
        Ok(answer.map(|mut answer| {
            answer.values.truncate(usize::from(count));
            answer
        }))
    }

    /// How many more answers with this id come within `patience`: more than none means several servos with one id.
    pub(crate) fn further_answers(&mut self, id: u8, patience: Duration) -> Result<usize, ServoError> {
        self.late.clear();
        self.rest(patience)?;
        Ok(self.late.iter().filter(|&&late| late == id).count())
    }

    /// The servos whose answers came too late, since this was last asked.
    pub(crate) fn take_late(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.late)
    }

    /// How many damaged frames were heard since this was last asked.
    pub(crate) fn take_damaged(&mut self) -> usize {
        std::mem::take(&mut self.heard.damaged_frames)
    }

    /// Waits until nothing came for `silence`. Frames that came meanwhile are late answers.
    pub(crate) fn rest(&mut self, silence: Duration) -> Result<(), ServoError> {
        loop {
            self.look_for(&[], |_| false);
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
        patience: Duration,
        is_answer: impl Fn(&Frame<'_>) -> bool,
    ) -> Result<Option<Answer>, ServoError> {
        self.rest(Duration::ZERO)?;
        trace!("-> {request:02x?}");
        self.line.send(request)?;
        let deadline = self.line.now() + patience;
        loop {
            let has_more = self.receive(deadline.saturating_sub(self.line.now()))?;
            let answer = self.look_for(request, &is_answer);
            if answer.is_some() || (!has_more && self.line.now() >= deadline) {
                return Ok(answer);
            }
        }
    }

    /// Takes what comes within `patience`; `false` if nothing did.
    fn receive(&mut self, patience: Duration) -> Result<bool, ServoError> {
        let bytes = self.line.receive(patience)?;
        if !bytes.is_empty() {
            trace!("<- {bytes:02x?}");
        }
        self.heard.bytes += bytes.len();
        self.waiting.extend(&bytes);
        Ok(!bytes.is_empty())
    }

    /// Looks for the answer among the bytes that are here. What stands behind it is kept.
    fn look_for(&mut self, request: &[u8], is_answer: impl Fn(&Frame<'_>) -> bool) -> Option<Answer> {
        loop {
            while let Some(found) = self.decoder.pull() {
                match found {
                    Err(_) => self.heard.damaged_frames += 1,
                    Ok(frame) if is_echo(&frame, request) => {
                        self.has_echo = true;
                        self.heard.echoes += 1;
                    }
                    Ok(frame) if is_answer(&frame) => {
                        return Some(Answer { errors: frame.code, values: frame.params.to_vec() });
                    }
                    Ok(frame) => {
                        self.heard.other_frames += 1;
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
