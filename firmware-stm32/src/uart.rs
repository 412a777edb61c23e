//! A serial line: a queue each way, with the interrupt at one end and the loop at the other.
//!
//! ```text
//!             interrupt                     loop
//!   RX ──▶ DR ──▶ received ─── queue ───▶ chunk ──▶ BufRead
//!   TX ◀── DR ◀── to_send ◀─── queue ◀───────────── Write
//! ```
//!
//! The interrupt alone touches the registers. The loop sends by pending it: in QEMU 7.2 a transmitter that
//! falls empty does not interrupt by itself.
//!
//! Where the queue is full a byte stays in the USART, and the interrupt stays off until the loop's next turn.
//! In the emulator the sender waits then; on a wire the next byte but one is an over-run, which is told.
//!
//! Both ends reach the queues through a critical section, the loop for eight bytes at a time: even on the
//! internal oscillator that is less than the 10 microseconds which a byte on the servo bus may wait. heapless
//! can do without, but the halves it splits a queue into divide by a length that only the running program
//! knows: a division per byte, and a path to a panic in every interrupt.

use core::cell::RefCell;
use core::convert::Infallible;
use core::ops::Deref;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embedded_io::{BufRead, ErrorType, Read, ReadReady, Write, WriteReady};
use heapless::spsc::Queue;
use stm32f4::stm32f405 as pac;

/// Bytes that the loop moves at once.
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

/// What both ends of a line share. Each queue holds one byte less than its size.
pub(crate) struct Line<U, const RECEIVE: usize, const TRANSMIT: usize>(
    Mutex<RefCell<State<U, RECEIVE, TRANSMIT>>>,
);

struct State<U, const RECEIVE: usize, const TRANSMIT: usize> {
    usart: Option<U>,
    received: Queue<u8, RECEIVE>,
    to_send: Queue<u8, TRANSMIT>,
    overrun: bool,
}

/// How a line is set up; always 8N1.
pub(crate) struct Setup {
    /// What the bus clock is divided by.
    pub(crate) divisor: u16,
    /// It transmits and receives on its TX pin.
    pub(crate) one_wire: bool,
    /// Interrupt priority.
    pub(crate) priority: u8,
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> Line<U, RECEIVE, TRANSMIT> {
    /// A line that is still closed.
    pub(crate) const fn new() -> Self {
        let state = State { usart: None, received: Queue::new(), to_send: Queue::new(), overrun: false };
        Self(Mutex::new(RefCell::new(state)))
    }

    /// Opens the line. But for the setup, a USART comes out of reset as it is wanted.
    pub(crate) fn open(&'static self, usart: U, setup: &Setup, nvic: &mut NVIC) -> End<U, RECEIVE, TRANSMIT> {
        let [low, high] = setup.divisor.to_le_bytes();
        let mantissa = u16::from(high) << 4 | u16::from(low >> 4);
        usart.brr().write(|w| w.div_mantissa().set(mantissa).div_fraction().set(low & 0xF));
        usart.cr3().write(|w| w.hdsel().bit(setup.one_wire));
        usart.cr1().write(|w| w.ue().enabled().te().enabled().re().enabled().rxneie().enabled());
        self.with(|state| state.usart = Some(usart));
        // SAFETY: nothing in this program counts on a priority to keep an interrupt out.
        unsafe { nvic.set_priority(U::INTERRUPT, setup.priority) };
        self.admit();
        End { line: self, chunk: heapless::Vec::new(), taken: 0 }
    }

    /// What the interrupt has to do.
    pub(crate) fn serve(&self) {
        self.with(State::serve);
    }

    /// Lets the interrupt come, should it have been shut out for want of room.
    fn admit(&self) {
        // SAFETY: nothing in this program counts on an interrupt being masked to keep it out.
        unsafe { NVIC::unmask(U::INTERRUPT) };
    }

    fn with<T: Default>(&self, act: impl FnOnce(&mut State<U, RECEIVE, TRANSMIT>) -> T) -> T {
        critical_section::with(|cs| {
            // Nobody else has it: nothing that `act` does comes back here.
            self.0.borrow(cs).try_borrow_mut().map_or_else(|_| T::default(), |mut state| act(&mut state))
        })
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> State<U, RECEIVE, TRANSMIT> {
    fn serve(&mut self) {
        let Self { usart: Some(usart), received, to_send, overrun } = self else { return };
        if !receive(usart, received, overrun) {
            NVIC::mask(U::INTERRUPT);
        }
        send(usart, to_send);
    }
}

/// Fetches a byte that has come; false if there is no room for it.
fn receive<const N: usize>(usart: &impl Usart, received: &mut Queue<u8, N>, overrun: &mut bool) -> bool {
    let status = usart.sr().read();
    let has_byte = status.rxne().bit_is_set();
    if status.ore().bit_is_set() {
        *overrun = true;
    } else if !has_byte {
        return true;
    }
    if has_byte && received.is_full() {
        return false;
    }
    // Reading DR after SR also clears an over-run (RM0090, section 30.6.1).
    let [byte, _] = usart.dr().read().dr().bits().to_le_bytes();
    if has_byte {
        // Cannot fail: there is room.
        let _ = received.enqueue(byte);
    }
    true
}

/// Sends what the transmitter takes, and asks to be called again if that is not all.
fn send<const N: usize>(usart: &impl Usart, to_send: &mut Queue<u8, N>) {
    while !to_send.is_empty()
        && usart.sr().read().txe().bit_is_set()
        && let Some(byte) = to_send.dequeue()
    {
        usart.dr().write(|w| w.dr().set(u16::from(byte)));
    }
    usart.cr1().modify(|_, w| w.txeie().bit(!to_send.is_empty()));
}

/// The loop's end of a line.
pub(crate) struct End<U: 'static, const RECEIVE: usize, const TRANSMIT: usize> {
    line: &'static Line<U, RECEIVE, TRANSMIT>,
    chunk: heapless::Vec<u8, CHUNK>,
    /// Bytes of the chunk that were consumed.
    taken: usize,
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> End<U, RECEIVE, TRANSMIT> {
    /// Does any byte wait to be read?
    pub(crate) fn has_received(&self) -> bool {
        self.taken < self.chunk.len() || self.line.with(|state| !state.received.is_empty())
    }

    /// How many bytes wait to be read.
    pub(crate) fn waiting(&self) -> usize {
        self.chunk.len() - self.taken + self.line.with(|state| state.received.len())
    }

    /// How many bytes can be written at once.
    pub(crate) fn room(&self) -> usize {
        self.line.with(|state| state.to_send.capacity() - state.to_send.len())
    }

    /// Were bytes lost since the last call because nobody fetched them in time?
    pub(crate) fn take_overrun(&self) -> bool {
        self.line.with(|state| core::mem::take(&mut state.overrun))
    }

    /// The first of the bytes that wait to be read; none where none waits.
    pub(crate) fn received(&mut self) -> &[u8] {
        let Self { line, chunk, taken } = self;
        // Even where nothing is taken out: the interrupt that is shut out sends, too, and room to send may be what
        // the bytes that wait here are waiting for.
        line.admit();
        if *taken >= chunk.len() {
            chunk.clear();
            *taken = 0;
            line.with(|state| {
                while !chunk.is_full()
                    && let Some(byte) = state.received.dequeue()
                {
                    // Cannot fail: there is room.
                    let _ = chunk.push(byte);
                }
            });
        }
        chunk.get(*taken..).unwrap_or(&[])
    }

    fn wait(&self) {
        self.line.admit();
        cortex_m::asm::wfi();
    }
}

impl<U, const RECEIVE: usize, const TRANSMIT: usize> ErrorType for End<U, RECEIVE, TRANSMIT> {
    type Error = Infallible;
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> ReadReady for End<U, RECEIVE, TRANSMIT> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.has_received())
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> BufRead for End<U, RECEIVE, TRANSMIT> {
    fn fill_buf(&mut self) -> Result<&[u8], Infallible> {
        while !self.has_received() {
            self.wait();
        }
        Ok(self.received())
    }

    fn consume(&mut self, count: usize) {
        self.taken = self.chunk.len().min(self.taken + count);
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> Read for End<U, RECEIVE, TRANSMIT> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = self.fill_buf()?;
        let count = bytes.iter().zip(buffer).map(|(from, to)| *to = *from).count();
        self.consume(count);
        Ok(count)
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> WriteReady for End<U, RECEIVE, TRANSMIT> {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.room() > 0)
    }
}

impl<U: Usart, const RECEIVE: usize, const TRANSMIT: usize> Write for End<U, RECEIVE, TRANSMIT> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        loop {
            let count = self.line.with(|state| {
                bytes.iter().take(CHUNK).take_while(|&&byte| state.to_send.enqueue(byte).is_ok()).count()
            });
            if count > 0 || bytes.is_empty() {
                NVIC::pend(U::INTERRUPT);
                return Ok(count);
            }
            self.wait();
        }
    }

    /// As the trait has it, less its panic at a `write` that takes nothing.
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
