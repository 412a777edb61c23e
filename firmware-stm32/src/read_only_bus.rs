//! The servo bus of the self-test image. It sends only questions.

use embedded_io::{BufRead, Write};
use firmware_stm32::chip::board;
use firmware_stm32::chip::clock;
use firmware_stm32::chip::delay::delay_micros;
use firmware_stm32::chip::servo_link::ServoUart;
use firmware_stm32::chip::uart::Received;
use firmware_stm32::line_errors::LineErrors;
use firmware_stm32::question::{AnswerParams, BusQuestion};
use motion_core::servo_bus::ByteTime;

/// Room for the echo of a question and the answer to it.
const RECEIVED: usize = 64;

/// The bytes received after a question.
pub(crate) type ReceivedBytes = heapless::Vec<u8, RECEIVED>;

/// The servo bus. It owns the link, and its methods send nothing but a [`BusQuestion`].
pub(crate) struct ReadOnlyBus {
    link: ServoUart,
    timeout_micros: u32,
}

impl ReadOnlyBus {
    /// Takes ownership of the link. The timeout of an answer counts from the last byte of the question.
    pub(crate) const fn new(link: ServoUart, timeout_micros: u32) -> Self {
        Self { link, timeout_micros }
    }

    /// Receive errors since start.
    pub(crate) fn errors(&self) -> LineErrors {
        self.link.errors()
    }

    /// Sends a question. Returns the answer and its delay after the last byte of the question, in microseconds; `None` if no
    /// answer comes before the timeout.
    pub(crate) fn ask(&mut self, question: &BusQuestion) -> Option<(AnswerParams, u32)> {
        let mut answer = None;
        let taken = self.listen(question, |received| {
            answer = question.answer(received);
            answer.is_some()
        });
        answer.map(|answer| (answer, taken))
    }

    /// Sends a question to an absent servo, and returns its echo: the received bytes, once they are as many as were sent, or at
    /// the timeout.
    pub(crate) fn echo(&mut self, question: &BusQuestion) -> ReceivedBytes {
        let mut echo = ReceivedBytes::new();
        self.listen(question, |received| {
            echo.clear();
            // Cannot fail: both have the same capacity.
            let _ = echo.extend_from_slice(received);
            received.len() >= question.frame().len()
        });
        echo
    }

    /// Sends a question and receives until `is_enough` or the timeout. Returns the time since the last byte of the question
    /// was sent, in microseconds.
    fn listen(&mut self, question: &BusQuestion, mut is_enough: impl FnMut(&[u8]) -> bool) -> u32 {
        delay_micros(u32::try_from(board::SERVO_GUARD_TIME.as_micros()).unwrap_or(u32::MAX));
        self.take(&mut ReceivedBytes::new());
        let Ok(()) = self.link.write_all(question.frame());
        let length = ByteTime::at_baud(board::SERVO_BAUD).of(question.frame().len());
        let sent = clock::micros().wrapping_add(u32::try_from(length.as_micros()).unwrap_or(0));
        let mut received = ReceivedBytes::new();
        loop {
            // The difference is negative until the last byte is sent: count that as 0.
            let since = clock::micros().wrapping_sub(sent);
            let since = if since > u32::MAX / 2 { 0 } else { since };
            let before = received.len();
            self.take(&mut received);
            if (received.len() > before && is_enough(&received)) || since > self.timeout_micros {
                return since;
            }
        }
    }

    /// Takes what has arrived. No answer continues across a damaged byte, so the bytes before it are dropped.
    fn take(&mut self, received: &mut ReceivedBytes) {
        loop {
            let count = match self.link.received() {
                Received::Bytes([]) => return,
                Received::Bytes(bytes) => {
                    // Drop bytes that do not fit: they cannot belong to an answer.
                    bytes.iter().for_each(|&byte| _ = received.push(byte));
                    bytes.len()
                }
                Received::Damage => {
                    received.clear();
                    0
                }
            };
            self.link.consume(count);
        }
    }
}
