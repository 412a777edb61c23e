//! The line to the servos: USART2, half duplex on one wire. What it sends comes back as an echo, which
//! whoever listens has to know. A byte lost here is a wrong checksum or a missing answer, and those are
//! counted where the bus is understood.

use cortex_m::peripheral::NVIC;
use firmware_stm32::rates::{self, Rates};
use stm32f4::stm32f405::{USART2, interrupt};

use crate::board;
use crate::gpio::Drive;
use crate::uart::{End, Line, Setup};

/// Room for the echo of the longest frame and the answer to it.
const RECEIVE: usize = 128;
/// Room for the longest frame.
const TRANSMIT: usize = 128;

/// The loop's end of the line.
pub(crate) type ServoLink = End<USART2, RECEIVE, TRANSMIT>;

static LINE: Line<USART2, RECEIVE, TRANSMIT> = Line::new();

/// Opens the line.
pub(crate) fn open(usart: USART2, rates: Rates, nvic: &mut NVIC) -> ServoLink {
    board::SERVO_BUS.give_to(board::USART_FUNCTION, Drive::OpenDrain);
    let divisor = rates::usart_divisor(rates.apb1, board::SERVO_BAUD);
    LINE.open(usart, &Setup { divisor, one_wire: true, priority: board::SERVO_PRIORITY }, nvic)
}

#[interrupt]
fn USART2() {
    LINE.serve();
}
