//! Pins by name. Knows nothing of what hangs on them.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin, PinState};
use stm32f4::stm32f405 as pac;

/// The registers of a port.
type Registers = pac::gpioi::RegisterBlock;

/// Ports of the 64-pin package.
#[derive(Clone, Copy)]
pub(crate) enum Port {
    A,
    #[allow(dead_code, reason = "for other wiring")]
    B,
    C,
}

/// A pin of the chip.
#[derive(Clone, Copy)]
pub(crate) struct Pin {
    port: Port,
    number: u8,
}

/// The level at which what hangs on an output is on.
#[derive(Clone, Copy)]
pub(crate) enum Active {
    High,
    Low,
}

/// How a peripheral drives its pin.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Drive {
    PushPull,
    /// Low or nothing, with the weak pull-up of the chip.
    OpenDrain,
}

impl Port {
    fn registers(self) -> &'static Registers {
        let base: *const Registers = match self {
            Self::A => pac::GPIOA::ptr().cast(),
            Self::B => pac::GPIOB::ptr().cast(),
            Self::C => pac::GPIOC::ptr().cast(),
        };
        // SAFETY: the address of a port of this chip; all ports have the same registers (RM0090, section
        // 8.4), the crate has several types for them because their reset values differ. They live as
        // long as the program, and every access is volatile.
        unsafe { &*base }
    }
}

impl Pin {
    /// Pin `number`, 0 to 15, of a port.
    pub(crate) const fn new(port: Port, number: u8) -> Self {
        assert!(number < 16);
        Self { port, number }
    }

    /// Gives the pin to a peripheral.
    pub(crate) fn give_to(self, function: u8, drive: Drive) {
        let port = self.port.registers();
        let n = self.n();
        if n < 8 {
            port.afrl().modify(|_, w| w.afr(n & 7).set(function & 0xF));
        } else {
            port.afrh().modify(|_, w| w.afr(n & 7).set(function & 0xF));
        }
        match drive {
            Drive::PushPull => port.otyper().modify(|_, w| w.ot(n).push_pull()),
            Drive::OpenDrain => port.otyper().modify(|_, w| w.ot(n).open_drain()),
        };
        port.pupdr().modify(|_, w| w.pupdr(n).pull_up());
        port.ospeedr().modify(|_, w| w.ospeedr(n).medium_speed());
        port.moder().modify(|_, w| w.moder(n).alternate());
    }

    /// Makes the pin an output, at the level for off.
    pub(crate) fn into_switch(self, active: Active) -> Switch<Output> {
        let switch = Switch::new(Output(self), active);
        self.port.registers().moder().modify(|_, w| w.moder(self.n()).output());
        switch
    }

    /// Drives the pin, whoever has it.
    pub(crate) fn drive(self, state: PinState) {
        // A write sets or clears single pins and leaves the others alone (RM0090, section 8.4.7).
        self.port.registers().bsrr().write(|w| match state {
            PinState::High => w.bs(self.n()).set_bit(),
            PinState::Low => w.br(self.n()).set_bit(),
        });
    }

    /// The number, as the compiler knows it is one.
    const fn n(self) -> u8 {
        self.number & 0xF
    }
}

impl Active {
    /// The level for on or off.
    pub(crate) fn level(self, on: bool) -> PinState {
        PinState::from(on == matches!(self, Self::High))
    }
}

/// A pin that drives a level.
pub(crate) struct Output(Pin);

impl ErrorType for Output {
    type Error = Infallible;
}

impl OutputPin for Output {
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

/// Something that is on or off, on any pin.
pub(crate) struct Switch<P> {
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

    /// Switches it, unless it is that way already.
    pub(crate) fn set(&mut self, on: bool) {
        if self.on != on {
            let Ok(()) = self.pin.set_state(self.active.level(on));
            self.on = on;
        }
    }
}
