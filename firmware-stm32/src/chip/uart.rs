//! A USART of the chip with its line, shared by interrupt and main loop.
//!
//! ```text
//!             interrupt                  loop
//!   RX ──▶ ┌────────────┐ ──▶ chunk ──▶ received, BufRead
//!   TX ◀── │ SerialLine │ ◀──────────── Write
//!          └────────────┘
//! ```
//!
//! After `open` only the line and the crash handler access the registers. The loop starts a transmission by pending the
//! interrupt, because in QEMU 7.2 an empty transmitter does not raise it.
//!
//! If the receive queue is full, the byte stays in the USART and the interrupt stays masked until the loop reads the
//! queue or waits. In the emulator the sender then waits. On a wire, an overrun occurs when the next byte is complete.
//! Overruns, framing errors and noise are counted.
//!
//! Both sides access the line in critical sections. A byte of the servo bus has to be read within 10 microseconds. So the loop
//! moves at most [`CHUNK`] bytes in a section, which takes less than that, even on the internal oscillator.

use core::cell::RefCell;
use core::convert::Infallible;
use core::marker::PhantomData;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embedded_io::{BufRead, ErrorType, Read, Write};
use stm32f4::stm32f405 as pac;

use crate::line_errors::LineErrors;
use crate::serial_line::{BusDirection, SerialLine, Taken, TransmitEvent, UsartRegisters};

/// The most bytes that the loop moves in one critical section.
pub const CHUNK: usize = 8;

/// A USART of the chip that a line can have: USART1 or USART2.
pub trait Usart {
    /// The interrupt whose handler calls [`SharedUart::serve`].
    const INTERRUPT: pac::Interrupt;

    /// Its registers, in the layout of USART1.
    fn registers() -> &'static pac::usart1::RegisterBlock;
}

impl Usart for pac::USART1 {
    const INTERRUPT: pac::Interrupt = pac::Interrupt::USART1;

    fn registers() -> &'static pac::usart1::RegisterBlock {
        // SAFETY: the address of the registers of this chip. Every access is volatile.
        unsafe { &*Self::ptr() }
    }
}

impl Usart for pac::USART2 {
    const INTERRUPT: pac::Interrupt = pac::Interrupt::USART2;

    fn registers() -> &'static pac::usart1::RegisterBlock {
        // SAFETY: as above.
        unsafe { &*Self::ptr() }
    }
}

/// The registers of the USART `U`, as its line uses them.
struct RegistersOf<U>(PhantomData<U>);

impl<U: Usart> UsartRegisters for RegistersOf<U> {
    fn status(&self) -> u16 {
        U::registers().sr().read().bits()
    }

    fn read(&mut self) -> u8 {
        let [byte, _] = U::registers().dr().read().dr().bits().to_le_bytes();
        byte
    }

    fn write(&mut self, byte: u8) {
        U::registers().dr().write(|w| w.dr().set(u16::from(byte)));
    }

    fn interrupt_on(&mut self, event: TransmitEvent) {
        U::registers().cr1().modify(|_, w| {
            w.txeie().bit(event == TransmitEvent::Empty).tcie().bit(event == TransmitEvent::Complete)
        });
    }
}

/// A line that interrupt and loop share.
pub struct SharedUart<U, D, const RECEIVE: usize, const TRANSMIT: usize>(
    Mutex<RefCell<SerialLine<RegistersOf<U>, D, RECEIVE, TRANSMIT>>>,
);

/// Configuration of a line. The format is always 8N1.
pub struct Setup {
    /// Divisor of the bus clock, in sixteenths.
    pub divisor: u16,
    /// Half duplex: transmit and receive on the TX pin.
    pub one_wire: bool,
    /// Interrupt priority, in the upper four bits; 0 is the most urgent.
    pub priority: u8,
}

impl<U: Usart, D: BusDirection, const RECEIVE: usize, const TRANSMIT: usize>
    SharedUart<U, D, RECEIVE, TRANSMIT>
{
    /// A closed line.
    pub const fn new(direction: D) -> Self {
        Self(Mutex::new(RefCell::new(SerialLine::new(RegistersOf(PhantomData), direction))))
    }

    /// Opens the line: enables transmitter, receiver and interrupt. Other USART settings that are not in `setup` keep their reset
    /// values. Takes the USART, so that no other code uses it.
    pub fn open(&'static self, _: U, setup: &Setup, nvic: &mut NVIC) -> UartPort<U, D, RECEIVE, TRANSMIT> {
        let usart = U::registers();
        let [low, high] = setup.divisor.to_le_bytes();
        let mantissa = u16::from(high) << 4 | u16::from(low >> 4);
        usart.brr().write(|w| w.div_mantissa().set(mantissa).div_fraction().set(low & 0xF));
        usart.cr3().write(|w| w.hdsel().bit(setup.one_wire));
        usart.cr1().write(|w| w.ue().enabled().te().enabled().re().enabled().rxneie().enabled());
        // SAFETY: no code relies on a priority to exclude an interrupt.
        unsafe { nvic.set_priority(U::INTERRUPT, setup.priority) };
        self.unmask();
        UartPort { line: self, chunk: [0; CHUNK], len: 0, taken: 0 }
    }

    /// Handles the interrupt. Masks it when a byte cannot be taken, because the receive queue is full.
    pub fn serve(&self) {
        self.with(|line| {
            if !line.serve() {
                NVIC::mask(U::INTERRUPT);
            }
        });
    }

    /// Unmasks the interrupt. [`Self::serve`] masks it when a byte finds the receive queue full.
    fn unmask(&self) {
        // SAFETY: no code relies on this interrupt being masked.
        unsafe { NVIC::unmask(U::INTERRUPT) };
    }

    fn with<T: Default>(
        &self,
        act: impl FnOnce(&mut SerialLine<RegistersOf<U>, D, RECEIVE, TRANSMIT>) -> T,
    ) -> T {
        critical_section::with(|cs| {
            // The borrow cannot fail: `act` never calls this function.
            self.0.borrow(cs).try_borrow_mut().map_or_else(|_| T::default(), |mut line| act(&mut line))
        })
    }
}

/// What [`UartPort::received`] finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received<'a> {
    /// The first bytes that are ready to be read; empty if there are none.
    Bytes(&'a [u8]),
    /// A damaged byte, or a gap where bytes were lost. It is already removed from the queue.
    Damage,
}

/// A line as the main loop uses it.
pub struct UartPort<U: 'static, D: 'static, const RECEIVE: usize, const TRANSMIT: usize> {
    line: &'static SharedUart<U, D, RECEIVE, TRANSMIT>,
    chunk: [u8; CHUNK],
    /// Bytes in the chunk.
    len: usize,
    /// Consumed bytes of the chunk.
    taken: usize,
}

impl<U: Usart, D: BusDirection, const RECEIVE: usize, const TRANSMIT: usize>
    UartPort<U, D, RECEIVE, TRANSMIT>
{
    /// True if a byte is ready to be read, or damage to be taken.
    pub fn has_received(&self) -> bool {
        self.taken < self.len || self.line.with(|line| line.waiting() > 0)
    }

    /// Number of bytes that are ready to be read. Damage counts as one.
    pub fn waiting(&self) -> usize {
        self.len - self.taken + self.line.with(|line| line.waiting())
    }

    /// Number of bytes that can be written without waiting.
    pub fn room(&self) -> usize {
        self.line.with(|line| line.room())
    }

    /// Receive errors since start.
    pub fn errors(&self) -> LineErrors {
        self.line.with(|line| line.errors())
    }

    /// True if bytes were lost since start because they were not read in time.
    pub fn has_overrun(&self) -> bool {
        self.line.with(|line| line.errors().overruns > 0)
    }

    /// True if bytes are queued for sending, or if a switched bus is still driven.
    pub fn is_sending(&self) -> bool {
        self.line.with(|line| line.is_sending())
    }

    /// The first bytes that are ready to be read, or the damage before them.
    pub fn received(&mut self) -> Received<'_> {
        match self.refill() {
            Taken::Bytes(_) => Received::Bytes(self.chunk.get(self.taken..self.len).unwrap_or(&[])),
            Taken::Damage => Received::Damage,
        }
    }

    /// Unmasks the interrupt, and takes the next chunk once the last one is consumed. Returns what is ready to be read.
    fn refill(&mut self) -> Taken {
        let Self { line, chunk, len, taken } = self;
        // Unmask even if the loop takes no byte. The same interrupt sends, and the controller may wait for room to send
        // before it takes more bytes.
        line.unmask();
        if *taken >= *len {
            *taken = 0;
            *len = 0;
            match line.with(|line| line.take(chunk)) {
                Taken::Bytes(count) => *len = count,
                Taken::Damage => return Taken::Damage,
            }
        }
        Taken::Bytes(*len - *taken)
    }

    fn wait(&self) {
        self.line.unmask();
        cortex_m::asm::wfi();
    }
}

impl<U, D, const RECEIVE: usize, const TRANSMIT: usize> ErrorType for UartPort<U, D, RECEIVE, TRANSMIT> {
    type Error = Infallible;
}

impl<U: Usart, D: BusDirection, const RECEIVE: usize, const TRANSMIT: usize> BufRead
    for UartPort<U, D, RECEIVE, TRANSMIT>
{
    /// Waits until bytes are ready. Skips damage.
    fn fill_buf(&mut self) -> Result<&[u8], Infallible> {
        loop {
            match self.refill() {
                Taken::Bytes(0) => self.wait(),
                Taken::Bytes(_) => return Ok(self.chunk.get(self.taken..self.len).unwrap_or(&[])),
                Taken::Damage => {}
            }
        }
    }

    fn consume(&mut self, count: usize) {
        self.taken = self.len.min(self.taken + count);
    }
}

impl<U: Usart, D: BusDirection, const RECEIVE: usize, const TRANSMIT: usize> Read
    for UartPort<U, D, RECEIVE, TRANSMIT>
{
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = self.fill_buf()?;
        let count = bytes.iter().zip(buffer).map(|(from, to)| *to = *from).count();
        self.consume(count);
        Ok(count)
    }
}

impl<U: Usart, D: BusDirection, const RECEIVE: usize, const TRANSMIT: usize> Write
    for UartPort<U, D, RECEIVE, TRANSMIT>
{
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        loop {
            let chunk = bytes.get(..CHUNK).unwrap_or(bytes);
            let count = self.line.with(|line| line.push(chunk));
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
        while self.is_sending() {
            self.wait();
        }
        Ok(())
    }
}
