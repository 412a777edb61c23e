//! The host link: USART1. The firmware opens it at the baud rate from the settings, the self-test image at 115,200 baud.

use cortex_m::peripheral::NVIC;
use stm32f4::stm32f405::{USART1, interrupt};

use super::board;
use super::gpio::OutputType;
use super::uart::{Setup, SharedUart, UartPort};
use crate::clock_rates::{self, ClockRates};
use crate::serial_line::NoDirection;

/// Room for a burst of requests while replies of 262 bytes are sent.
const RECEIVE: usize = 2048;
/// Room for three replies of 262 bytes.
const TRANSMIT: usize = 1024;

/// The host link as the main loop uses it.
pub type HostUart = UartPort<USART1, NoDirection, RECEIVE, TRANSMIT>;

static LINE: SharedUart<USART1, NoDirection, RECEIVE, TRANSMIT> = SharedUart::new(NoDirection);

/// Opens the host link at `baud`, in bits per second.
pub fn open(usart: USART1, rates: ClockRates, baud: u32, nvic: &mut NVIC) -> HostUart {
    board::HOST_TRANSMIT.give_to(board::USART_FUNCTION, OutputType::PushPull);
    board::HOST_RECEIVE.give_to(board::USART_FUNCTION, OutputType::PushPull);
    let divisor = clock_rates::usart_divisor(rates.apb2, baud);
    LINE.open(usart, &Setup { divisor, one_wire: false, priority: board::HOST_PRIORITY }, nvic)
}

#[interrupt]
fn USART1() {
    LINE.serve();
}
