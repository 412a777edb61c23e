//! The servo bus: USART2, half duplex on one wire. Sent bytes come back as an echo, and the receiver has to skip it. A lost
//! byte causes a wrong checksum or a missing answer: motion-core counts those, this line counts its receive errors.

use cortex_m::peripheral::NVIC;
use firmware_stm32::clock_rates::{self, ClockRates};
use stm32f4::stm32f405::{USART2, interrupt};

use crate::board;
use crate::gpio::OutputType;
use crate::uart::{Setup, SharedUart, UartPort};

/// Room for the echo of the longest frame and the answer to it.
const RECEIVE: usize = 128;
/// Room for the longest frame.
const TRANSMIT: usize = 128;

/// The servo bus as the main loop uses it.
pub(crate) type ServoLink = UartPort<USART2, RECEIVE, TRANSMIT>;

static LINE: SharedUart<USART2, RECEIVE, TRANSMIT> = SharedUart::new();

/// Opens the servo bus.
pub(crate) fn open(usart: USART2, rates: ClockRates, nvic: &mut NVIC) -> ServoLink {
    board::SERVO_BUS.give_to(board::USART_FUNCTION, OutputType::OpenDrain);
    let divisor = clock_rates::usart_divisor(rates.apb1, board::SERVO_BAUD);
    LINE.open(usart, &Setup { divisor, one_wire: true, priority: board::SERVO_PRIORITY }, nvic)
}

#[interrupt]
fn USART2() {
    LINE.serve();
}
