//! A serial line with a queue in each direction, between the USART interrupt and the main loop.
//!
//! ```text
//!             interrupt                     loop
//!   RX ──▶ DR ──▶ received ─── queue ───▶ chunk ──▶ BufRead
//!   TX ◀── DR ◀── to_send ◀─── queue ◀───────────── Write
//! ```
//!
//! Only the interrupt accesses the registers. The loop starts a transmission by pending the interrupt, because in QEMU 7.2
//! an empty transmitter does not raise it.
//!
//! If the receive queue is full, the byte stays in the USART and the interrupt stays masked until the loop reads the
//! queue. In the emulator the sender then waits. On a wire the byte after the next one is an overrun. Overruns and all
//! other receive errors are counted.
//!
//! Both sides access the queues in a critical section. The loop moves few bytes in each, so that even on the internal
//! oscillator it takes less than the 10 microseconds within which a byte of the servo bus has to be read.

use core::cell::RefCell;
use core::convert::Infallible;
use core::ops::Deref;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embedded_io::{BufRead, ErrorType, Read, ReadReady, Write, WriteReady};
use firmware_stm32::byte_queue::ByteQueue;
use firmware_stm32::line_errors::{self, LineErrors};
use stm32f4::stm32f405 as pac;

/// Bytes that the loop moves in one critical section.
pub(crate) const CHUNK: usize = 8;

/// One of the chip's USARTs.
pub(crate) trait Usart: Deref<Target = pac::usart1::RegisterBlock> {
    /// Its interrupt.
    const INTERRUPT: pac::Interrupt;
}

impl Usart for pac::USART1 {
    const INTERRUPT: pac::Interrupt = pac::Interrupt::USART1;
}

impl Usart for pac::USART2 {
    const INTERRUPT: pac::Interrupt = pac::Interrupt::USART2;
}

/// The state that interrupt and loop share.
pub(crate) struct SharedUart<U, const RECEIVE: usize, const TRANSMIT: usize>(
    Mutex<RefCell<State<U, RECEIVE, TRANSMIT>>>,
);

struct State<U, const RECEIVE: usize, const TRANSMIT: usize> {
    usart: Option<U>,
    received: ByteQueue<RECEIVE>,
    to_send: ByteQueue<TRANSMIT>,
    errors: LineErrors,
}

/// Configuration of a line. The format is always 8N1.
pub(crate) struct Setup {
    /// Divisor of the bus clock, in sixteenths.
    pub(crate) divisor: u16,
    /// Half duplex: transmit and receive on the TX pin.
    pub(crate) one_wire: bool,
    /// Interrupt priority.
    pub(crate) priority: u8,
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> SharedUart<U, RECEIVE, TRANSMIT> {
    /// A closed line.
    pub(crate) const fn new() -> Self {
        let state = State {
            usart: None,
            received: ByteQueue::new(),
            to_send: ByteQueue::new(),
            errors: LineErrors::new(),
        };
        Self(Mutex::new(RefCell::new(state)))
    }

    /// Opens the line. All other USART settings keep their reset values.
    pub(crate) fn open(
        &'static self,
        usart: U,
        setup: &Setup,
        nvic: &mut NVIC,
    ) -> UartPort<U, RECEIVE, TRANSMIT> {
        let [low, high] = setup.divisor.to_le_bytes();
        let mantissa = u16::from(high) << 4 | u16::from(low >> 4);
        usart.brr().write(|w| w.div_mantissa().set(mantissa).div_fraction().set(low & 0xF));
        usart.cr3().write(|w| w.hdsel().bit(setup.one_wire));
        usart.cr1().write(|w| w.ue().enabled().te().enabled().re().enabled().rxneie().enabled());
        self.with(|state| state.usart = Some(usart));
        // SAFETY: no code relies on a priority to exclude an interrupt.
        unsafe { nvic.set_priority(U::INTERRUPT, setup.priority) };
        self.unmask();
        UartPort { line: self, chunk: [0; CHUNK], len: 0, taken: 0 }
    }

    /// The interrupt handler.
    pub(crate) fn serve(&self) {
        self.with(State::serve);
    }

    /// Unmasks the interrupt, which is masked while the receive queue is full.
    fn unmask(&self) {
        // SAFETY: no code relies on this interrupt being masked.
        unsafe { NVIC::unmask(U::INTERRUPT) };
    }

    fn with<T: Default>(&self, act: impl FnOnce(&mut State<U, RECEIVE, TRANSMIT>) -> T) -> T {
        critical_section::with(|cs| {
            // The borrow cannot fail: `act` never calls this function.
            self.0.borrow(cs).try_borrow_mut().map_or_else(|_| T::default(), |mut state| act(&mut state))
        })
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> State<U, RECEIVE, TRANSMIT> {
    fn serve(&mut self) {
        let Self { usart: Some(usart), received, to_send, errors } = self else { return };
        if !receive(usart, received, errors) {
            NVIC::mask(U::INTERRUPT);
        }
        send(usart, to_send);
    }
}

/// Moves a received byte to the queue. Returns false if the queue is full.
fn receive<const N: usize>(usart: &impl Usart, received: &mut ByteQueue<N>, errors: &mut LineErrors) -> bool {
    let status = usart.sr().read().bits();
    let seen = status & (line_errors::RECEIVED | line_errors::ERRORS);
    if seen == 0 {
        return true;
    }
    if received.is_full() && status & line_errors::RECEIVED != 0 {
        return false;
    }
    // Reading DR after SR also clears the errors (RM0090, section 30.6.1).
    let [byte, _] = usart.dr().read().dr().bits().to_le_bytes();
    if seen != line_errors::RECEIVED {
        errors.count(status);
        if status & line_errors::RECEIVED == 0 {
            return true;
        }
    }
    received.push(byte);
    true
}

/// Passes queued bytes to the transmitter, and enables its interrupt if more bytes are queued.
fn send<const N: usize>(usart: &impl Usart, to_send: &mut ByteQueue<N>) {
    while !to_send.is_empty()
        && usart.sr().read().txe().bit_is_set()
        && let Some(byte) = to_send.pop()
    {
        usart.dr().write(|w| w.dr().set(u16::from(byte)));
    }
    usart.cr1().modify(|_, w| w.txeie().bit(!to_send.is_empty()));
}

/// A line as the main loop uses it.
pub(crate) struct UartPort<U: 'static, const RECEIVE: usize, const TRANSMIT: usize> {
    line: &'static SharedUart<U, RECEIVE, TRANSMIT>,
    chunk: [u8; CHUNK],
    /// Bytes in the chunk.
    len: usize,
    /// Consumed bytes of the chunk.
    taken: usize,
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> UartPort<U, RECEIVE, TRANSMIT> {
    /// True if a byte is ready to be read.
    pub(crate) fn has_received(&self) -> bool {
        self.taken < self.len || self.line.with(|state| !state.received.is_empty())
    }

    /// Number of bytes that are ready to be read.
    pub(crate) fn waiting(&self) -> usize {
        self.len - self.taken + self.line.with(|state| state.received.len())
    }

    /// Number of bytes that can be written without waiting.
    pub(crate) fn room(&self) -> usize {
        self.line.with(|state| state.to_send.room())
    }

    /// Receive errors since start.
    pub(crate) fn errors(&self) -> LineErrors {
        self.line.with(|state| state.errors)
    }

    /// True if bytes were lost since start because they were not read in time.
    pub(crate) fn has_overrun(&self) -> bool {
        self.line.with(|state| state.errors.overruns > 0)
    }

    /// True if bytes are queued for sending.
    pub(crate) fn is_sending(&self) -> bool {
        self.line.with(|state| !state.to_send.is_empty())
    }

    /// The first bytes that are ready to be read; empty if there are none.
    pub(crate) fn received(&mut self) -> &[u8] {
        let Self { line, chunk, len, taken } = self;
        // Unmask even if the loop takes no byte. The masked interrupt also sends, and the controller may wait for room to
        // send before it takes more bytes.
        line.unmask();
        if *taken >= *len {
            *taken = 0;
            *len = line.with(|state| state.received.pop_all(chunk));
        }
        chunk.get(*taken..*len).unwrap_or(&[])
    }

    fn wait(&self) {
        self.line.unmask();
        cortex_m::asm::wfi();
    }
}

impl<U, const RECEIVE: usize, const TRANSMIT: usize> ErrorType for UartPort<U, RECEIVE, TRANSMIT> {
    type Error = Infallible;
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> ReadReady for UartPort<U, RECEIVE, TRANSMIT> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.has_received())
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> BufRead for UartPort<U, RECEIVE, TRANSMIT> {
    fn fill_buf(&mut self) -> Result<&[u8], Infallible> {
        while !self.has_received() {
            self.wait();
        }
        Ok(self.received())
    }

    fn consume(&mut self, count: usize) {
        self.taken = self.len.min(self.taken + count);
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> Read for UartPort<U, RECEIVE, TRANSMIT> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = self.fill_buf()?;
        let count = bytes.iter().zip(buffer).map(|(from, to)| *to = *from).count();
        self.consume(count);
        Ok(count)
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> WriteReady for UartPort<U, RECEIVE, TRANSMIT> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.room() > 0)
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> Write for UartPort<U, RECEIVE, TRANSMIT> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        loop {
            let chunk = bytes.get(..CHUNK).unwrap_or(bytes);
            let count = self.line.with(|state| state.to_send.push_all(chunk));
            if count > 0 || bytes.is_empty() {
                NVIC::pend(U::INTERRUPT);
                return Ok(count);
            }
            self.wait();
        }
    }

    /// The default of the trait panics if `write` returns 0. This one has no path to a panic.
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), Infallible> {
        let mut rest = bytes;
        while !rest.is_empty() {
            let count = self.write(rest)?;
            rest = rest.get(count..).unwrap_or(&[]);
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        while !self.line.with(|state| state.to_send.is_empty()) {
            self.wait();
        }
        Ok(())
    }
}
