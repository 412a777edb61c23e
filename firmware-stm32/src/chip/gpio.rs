//! The pins of the chip. `board.rs` says what is connected to them.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin, PinState};
use stm32f4::stm32f405 as pac;

/// Enables the clocks of the ports. The read gives them the delay that they need before the first access (errata ES0182,
/// delay after an RCC peripheral clock enabling).
pub fn enable(rcc: &pac::RCC) {
    rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled().gpioben().enabled().gpiocen().enabled());
    let _ = rcc.ahb1enr().read();
}

type GpioRegisters = pac::gpioi::RegisterBlock;

/// The ports that have all their 16 pins on the 64-pin package.
#[derive(Clone, Copy)]
pub enum GpioPort {
    /// GPIOA: pins PA0 to PA15.
    A,
    /// GPIOB: pins PB0 to PB15.
    B,
    /// GPIOC: pins PC0 to PC15.
    C,
}

/// A pin of the chip, by its port and its number.
#[derive(Clone, Copy)]
pub struct Pin {
    port: GpioPort,
    number: u8,
}

/// The level that switches the connected device on.
#[derive(Clone, Copy)]
pub enum Active {
    /// The device is on at the high level.
    High,
    /// The device is on at the low level.
    Low,
}

/// How a peripheral drives its pin.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum OutputType {
    /// Drives high and low. The chip's weak pull-up is on: it keeps an unconnected input high.
    PushPull,
    /// Drives low only; the pull-up is outside the chip. With its internal pull-up on, a pin would not be 5 V tolerant: at
    /// most VDD + 0.3 V (DS8626, table of the operating conditions).
    OpenDrain,
}

impl GpioPort {
    fn registers(self) -> &'static GpioRegisters {
        let base: *const GpioRegisters = match self {
            Self::A => pac::GPIOA::ptr().cast(),
            Self::B => pac::GPIOB::ptr().cast(),
            Self::C => pac::GPIOC::ptr().cast(),
        };
        // SAFETY: `base` is the address of a port of this chip. All ports have the same registers (RM0090, section 8.4);
        // the crate has several types because the reset values differ. Every access is volatile.
        unsafe { &*base }
    }
}

impl Pin {
    /// Pin `number`, 0 to 15, of a port.
    pub const fn new(port: GpioPort, number: u8) -> Self {
        assert!(number < 16);
        Self { port, number }
    }

    /// Connects the pin to a peripheral.
    pub fn give_to(self, function: u8, drive: OutputType) {
        let port = self.port.registers();
        let n = self.n();
        if n < 8 {
            port.afrl().modify(|_, w| w.afr(n & 7).set(function & 0xF));
        } else {
            port.afrh().modify(|_, w| w.afr(n & 7).set(function & 0xF));
        }
        match drive {
            OutputType::PushPull => {
                port.otyper().modify(|_, w| w.ot(n).push_pull());
                port.pupdr().modify(|_, w| w.pupdr(n).pull_up());
            }
            OutputType::OpenDrain => {
                port.otyper().modify(|_, w| w.ot(n).open_drain());
                port.pupdr().modify(|_, w| w.pupdr(n).floating());
            }
        }
        port.ospeedr().modify(|_, w| w.ospeedr(n).medium_speed());
        port.moder().modify(|_, w| w.moder(n).alternate());
    }

    /// Makes the pin an output, at the level that switches the device off.
    pub fn into_switch(self, active: Active) -> Switch<DigitalOutput> {
        let switch = Switch::new(DigitalOutput(self), active);
        self.make_output();
        switch
    }

    /// Makes the pin an output, at the level that was set last.
    pub fn make_output(self) {
        self.port.registers().moder().modify(|_, w| w.moder(self.n()).output());
    }

    /// Sets the level of the pin. The crash handler uses it without owning the pin.
    pub fn drive(self, state: PinState) {
        // BSRR sets or clears one pin and leaves the others unchanged (RM0090, section 8.4.7).
        self.port.registers().bsrr().write(|w| match state {
            PinState::High => w.bs(self.n()).set_bit(),
            PinState::Low => w.br(self.n()).set_bit(),
        });
    }

    /// The pin number. The mask lets the compiler drop range checks.
    const fn n(self) -> u8 {
        self.number & 0xF
    }
}

impl Active {
    /// The level for on or off.
    pub fn level(self, on: bool) -> PinState {
        PinState::from(on == matches!(self, Self::High))
    }
}

/// A pin that is an output. Setting its level cannot fail.
pub struct DigitalOutput(Pin);

impl ErrorType for DigitalOutput {
    type Error = Infallible;
}

impl OutputPin for DigitalOutput {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set_state(PinState::Low)
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set_state(PinState::High)
    }

    fn set_state(&mut self, state: PinState) -> Result<(), Infallible> {
        self.0.drive(state);
        Ok(())
    }
}

/// A device that is switched on and off by a pin.
pub struct Switch<P> {
    pin: P,
    active: Active,
    on: bool,
}

impl<P: OutputPin<Error = Infallible>> Switch<P> {
    fn new(pin: P, active: Active) -> Self {
        let mut switch = Self { pin, active, on: true };
        switch.set(false);
        switch
    }

    /// Switches the device. Writes to the pin only on a change.
    pub fn set(&mut self, on: bool) {
        if self.on != on {
            let Ok(()) = self.pin.set_state(self.active.level(on));
            self.on = on;
        }
    }
}
