//! The servo bus of the self-test image. It sends only questions.

use embedded_io::Write;
use firmware_stm32::line_errors::LineErrors;
use firmware_stm32::question::{Answer, Question};

use crate::board;
use crate::clock;
use crate::delay::delay_micros;
use crate::servo_link::ServoLink;

/// Room for the echo of a question and the answer to it.
const RECEIVED: usize = 64;
/// Duration of a byte at 1 Mbaud.
const BYTE_MICROS: u32 = 10;

/// The bytes received after a question.
pub(crate) type ReceivedBytes = heapless::Vec<u8, RECEIVED>;

/// The servo bus. It owns the link, and its methods send nothing but a [`Question`].
pub(crate) struct ReadOnlyBus {
    link: ServoLink,
    timeout_micros: u32,
}

impl ReadOnlyBus {
    /// Takes ownership of the link. The timeout of an answer counts from the last byte of the question.
    pub(crate) const fn new(link: ServoLink, timeout_micros: u32) -> Self {
        Self { link, timeout_micros }
    }

    /// Receive errors since start.
    pub(crate) fn errors(&self) -> LineErrors {
        self.link.errors()
    }

    /// Sends a question. Returns the answer and its delay after the last byte of the question, in microseconds.
    pub(crate) fn ask(&mut self, question: &Question) -> Option<(Answer, u32)> {
        let mut answer = None;
        let taken = self.listen(question, |received| {
            answer = question.answer(received);
            answer.is_some()
        });
        answer.map(|answer| (answer, taken))
    }

    /// Sends a question to an absent servo, and returns the bytes received before the timeout. On a wire the echo is
    /// complete with the last byte sent.
    pub(crate) fn echo(&mut self, question: &Question) -> ReceivedBytes {
        let mut echo = ReceivedBytes::new();
        self.listen(question, |received| {
            echo.clear();
            // Cannot fail: both have the same capacity.
            let _ = echo.extend_from_slice(received);
            received.len() >= question.frame().len()
        });
        echo
    }

    /// Sends a question and receives until `is_enough` or the timeout. Returns the time after the last byte sent.
    fn listen(&mut self, question: &Question, mut is_enough: impl FnMut(&[u8]) -> bool) -> u32 {
        delay_micros(u32::try_from(board::SERVO_GUARD_TIME.as_micros()).unwrap_or(u32::MAX));
        while self.take().is_some() {}
        let length = u32::try_from(question.frame().len()).unwrap_or(0);
        let Ok(()) = self.link.write_all(question.frame());
        let sent = clock::micros().wrapping_add(length * BYTE_MICROS);
        let mut received = ReceivedBytes::new();
        loop {
            // The difference is negative until the last byte is sent: count that as 0.
            let since = clock::micros().wrapping_sub(sent);
            let since = if since > u32::MAX / 2 { 0 } else { since };
            let before = received.len();
            while let Some(byte) = self.take() {
                // Drop bytes that do not fit: they cannot belong to an answer.
                let _ = received.push(byte);
            }
            if (received.len() > before && is_enough(&received)) || since > self.timeout_micros {
                return since;
            }
        }
    }

    fn take(&mut self) -> Option<u8> {
        let byte = self.link.received().first().copied();
        embedded_io::BufRead::consume(&mut self.link, usize::from(byte.is_some()));
        byte
    }
}
