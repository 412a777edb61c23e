//! The line to the host: USART1, at the baud rate that the settings name.

use cortex_m::peripheral::NVIC;
use firmware_stm32::rates::{self, Rates};
use stm32f4::stm32f405::{USART1, interrupt};

use crate::board;
use crate::gpio::Drive;
use crate::uart::{End, Line, Setup};

/// Room for a burst of requests while answers of 262 bytes go out.
const RECEIVE: usize = 2048;
/// Room for three such answers.
const TRANSMIT: usize = 1024;

/// The loop's end of the line.
pub(crate) type HostLink = End<USART1, RECEIVE, TRANSMIT>;

static LINE: Line<USART1, RECEIVE, TRANSMIT> = Line::new();

/// Opens the line.
pub(crate) fn open(usart: USART1, rates: Rates, baud: u32, nvic: &mut NVIC) -> HostLink {
    board::HOST_TRANSMIT.give_to(board::USART_FUNCTION, Drive::PushPull);
    board::HOST_RECEIVE.give_to(board::USART_FUNCTION, Drive::PushPull);
    let divisor = rates::usart_divisor(rates.apb2, baud);
    LINE.open(usart, &Setup { divisor, one_wire: false, priority: board::HOST_PRIORITY }, nvic)
}

#[interrupt]
fn USART1() {
    LINE.serve();
}
