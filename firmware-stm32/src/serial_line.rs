//! A serial line between the interrupt of its USART and the main loop: queues, receive errors, and the direction of a
//! buffered bus. It accesses the chip through [`UsartRegisters`] and [`BusDirection`] only.
//!
//! ```text
//!             interrupt                     loop
//!   RX ──▶ DR ──▶ received ─── queue ───▶ take
//!   TX ◀── DR ◀── to_send ◀─── queue ◀─── push
//!   DIR ────────▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔──────  from push until the last stop bit has left (TC)
//! ```
//!
//! The USART delivers a byte with a receive error like any other (RM0090, section 30.3.3), but the byte belongs to no frame. A
//! mark takes its place in the queue, so that no frame is parsed across it. After an overrun a byte is missing: a mark takes its
//! place as well. Tests: `serial_line/tests.rs`.

use crate::byte_queue::ByteQueue;
use crate::line_errors::LineErrors;
use crate::usart_status as status;

#[cfg(test)]
mod tests;

/// The event of the transmitter that raises the interrupt. A received byte always raises it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransmitEvent {
    /// No event of the transmitter.
    Never,
    /// The data register takes a byte (TXEIE).
    Empty,
    /// The last stop bit has left (TCIE).
    Complete,
}

/// The registers of a USART, behind a trait so that tests can put a model in their place.
pub trait UsartRegisters {
    /// Reads USART_SR.
    fn status(&self) -> u16;
    /// Reads a byte from USART_DR. After a read of USART_SR this clears the receive errors.
    fn read(&mut self) -> u8;
    /// Writes a byte to USART_DR. After a read of USART_SR this clears TC.
    fn write(&mut self, byte: u8);
    /// Selects the event of the transmitter that raises the interrupt.
    fn interrupt_on(&mut self, event: TransmitEvent);
}

/// The direction of the buffer of a bus.
pub trait BusDirection {
    /// False for a line without such a buffer: the line then calls neither function.
    const IS_SWITCHED: bool;
    /// Makes the board drive the bus.
    fn transmit(&mut self);
    /// Makes the board listen.
    fn receive(&mut self);
}

/// A line that needs no direction.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoDirection;

impl BusDirection for NoDirection {
    const IS_SWITCHED: bool = false;
    fn transmit(&mut self) {}
    fn receive(&mut self) {}
}

/// What [`SerialLine::take`] found at the front of the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// This many bytes; 0 if there are none.
    Bytes(usize),
    /// A damaged byte, or a gap where bytes were lost. It is already removed from the queue.
    Damage,
}

impl Default for Taken {
    fn default() -> Self {
        Self::Bytes(0)
    }
}

/// The byte in the queue at a mark. Its value has no meaning.
const MARK: u8 = 0;

/// A serial line. `RECEIVE` and `TRANSMIT` are the sizes of its queues, in bytes.
pub struct SerialLine<U, D, const RECEIVE: usize, const TRANSMIT: usize> {
    usart: U,
    direction: D,
    received: ByteQueue<RECEIVE>,
    /// How many bytes of `received` come before the mark; `None` without a mark.
    mark_at: Option<usize>,
    to_send: ByteQueue<TRANSMIT>,
    /// See [`Self::is_sending()`].
    is_sending: bool,
    /// The event that was last passed to [`UsartRegisters::interrupt_on`].
    event: TransmitEvent,
    errors: LineErrors,
}

impl<U: UsartRegisters, D: BusDirection, const RECEIVE: usize, const TRANSMIT: usize>
    SerialLine<U, D, RECEIVE, TRANSMIT>
{
    /// A line with empty queues.
    pub const fn new(usart: U, direction: D) -> Self {
        Self {
            usart,
            direction,
            received: ByteQueue::new(),
            mark_at: None,
            to_send: ByteQueue::new(),
            is_sending: false,
            event: TransmitEvent::Never,
            errors: LineErrors::new(),
        }
    }

    /// Handles the interrupt. Returns false if a byte cannot be taken, because the queue is full: then mask the interrupt.
    pub fn serve(&mut self) -> bool {
        let status = self.usart.status();
        let is_taken = self.receive(status);
        if self.is_sending {
            self.send(status);
        }
        is_taken
    }

    /// Moves a received byte to the queue. Returns false if the byte stays in the USART, because the queue is full.
    fn receive(&mut self, status: u16) -> bool {
        let seen = status & (status::RECEIVED | status::ERRORS);
        if seen == 0 {
            return true;
        }
        if self.received.is_full() && status & status::RECEIVED != 0 {
            return false;
        }
        // Reading DR after SR also clears the errors.
        let byte = self.usart.read();
        if seen == status::RECEIVED {
            self.received.push(byte);
        } else {
            self.receive_error(status, byte);
        }
        true
    }

    #[cold]
    fn receive_error(&mut self, status: u16, byte: u8) {
        self.errors.count(status);
        if status & status::RECEIVED != 0 && status & status::DAMAGED == 0 {
            // An overrun: this byte is good, and the next one is lost.
            self.received.push(byte);
        }
        // There is only one mark, so drop the bytes behind an older one. In a full queue the mark replaces the newest byte.
        let at = self.mark_at.unwrap_or(self.received.len()).min(RECEIVE - 1);
        self.received.truncate(at);
        self.received.push(MARK);
        self.mark_at = Some(at);
    }

    /// Passes queued bytes to the transmitter. Ends the transmission after the last one.
    fn send(&mut self, status: u16) {
        let mut status = status;
        while status & status::EMPTY != 0
            && let Some(byte) = self.to_send.pop()
        {
            self.usart.write(byte);
            status = self.usart.status();
        }
        let event = if !self.to_send.is_empty() {
            TransmitEvent::Empty
        } else if D::IS_SWITCHED && status & status::COMPLETE == 0 {
            TransmitEvent::Complete
        } else {
            self.end();
            TransmitEvent::Never
        };
        if self.event != event {
            self.event = event;
            self.usart.interrupt_on(event);
        }
    }

    fn end(&mut self) {
        self.is_sending = false;
        if D::IS_SWITCHED {
            self.direction.receive();
        }
    }

    /// Queues as many of `bytes` as there is room for, and returns how many. If any, the caller has to pend the
    /// interrupt.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        let count = self.to_send.push_all(bytes);
        if count > 0 {
            if D::IS_SWITCHED && !self.is_sending {
                self.direction.transmit();
            }
            self.is_sending = true;
        }
        count
    }

    /// Moves the oldest received bytes to `bytes`, as many as are queued and fit, up to a mark.
    pub fn take(&mut self, bytes: &mut [u8]) -> Taken {
        match self.mark_at {
            None => Taken::Bytes(self.received.pop_all(bytes)),
            Some(before) => self.take_before_mark(before, bytes),
        }
    }

    #[cold]
    fn take_before_mark(&mut self, before: usize, bytes: &mut [u8]) -> Taken {
        if before == 0 {
            self.mark_at = None;
            let _ = self.received.pop();
            return Taken::Damage;
        }
        let fitting = before.min(bytes.len());
        let count = self.received.pop_all(bytes.get_mut(..fitting).unwrap_or_default());
        self.mark_at = Some(before - count);
        Taken::Bytes(count)
    }

    /// Number of received bytes. A mark counts as a byte, so that the loop wakes up for it.
    pub const fn waiting(&self) -> usize {
        self.received.len()
    }

    /// Number of bytes that can be pushed.
    pub const fn room(&self) -> usize {
        self.to_send.room()
    }

    /// True from the first byte pushed until the transmitter has the last one; with a direction pin, until its stop bit is out.
    pub const fn is_sending(&self) -> bool {
        self.is_sending
    }

    /// Receive errors since the line was opened.
    pub const fn errors(&self) -> LineErrors {
        self.errors
    }
}
