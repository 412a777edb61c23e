//! The servo bus: USART2, half duplex on one wire. Sent bytes come back as an echo, and the receiver has to skip it. A lost
//! byte causes a wrong checksum or a missing answer: motion-core counts these two, and the line counts receive errors.
//!
//! A buffered bus has a direction pin. The pin switches to transmit before the first byte, and back to receive when the last
//! stop bit has left. On a bus without a buffer the pin switches too, without effect.

use cortex_m::peripheral::NVIC;
use stm32f4::stm32f405::{USART2, interrupt};

use super::board;
use super::gpio::OutputType;
use super::uart::{Setup, SharedUart, UartPort};
use crate::clock_rates::{self, ClockRates};
use crate::serial_line::BusDirection;

/// Room for the echo of the longest frame and the longest answer.
const RECEIVE: usize = 128;
/// Room for the longest frame.
const TRANSMIT: usize = 128;

/// The servo bus as the main loop uses it.
pub type ServoUart = UartPort<USART2, ServoDirection, RECEIVE, TRANSMIT>;

static LINE: SharedUart<USART2, ServoDirection, RECEIVE, TRANSMIT> = SharedUart::new(ServoDirection);

/// The direction pin of the board. The crash handler uses it without owning it.
#[derive(Clone, Copy, Debug)]
pub struct ServoDirection;

impl ServoDirection {
    /// Makes the pin an output, at the level at which the board listens.
    fn open(mut self) {
        if let Some((pin, _)) = board::SERVO_DIRECTION {
            self.receive();
            pin.make_output();
        }
    }

    fn drive(is_transmitting: bool) {
        if let Some((pin, active)) = board::SERVO_DIRECTION {
            pin.drive(active.level(is_transmitting));
        }
    }
}

impl BusDirection for ServoDirection {
    const IS_SWITCHED: bool = board::SERVO_DIRECTION.is_some();

    fn transmit(&mut self) {
        Self::drive(true);
    }

    fn receive(&mut self) {
        Self::drive(false);
    }
}

/// Opens the servo bus at [`board::SERVO_BAUD`], half duplex. The board listens.
pub fn open(usart: USART2, rates: ClockRates, nvic: &mut NVIC) -> ServoUart {
    ServoDirection.open();
    board::SERVO_BUS.give_to(board::USART_FUNCTION, OutputType::OpenDrain);
    let divisor = clock_rates::usart_divisor(rates.apb1, board::SERVO_BAUD);
    LINE.open(usart, &Setup { divisor, one_wire: true, priority: board::SERVO_PRIORITY }, nvic)
}

#[interrupt]
fn USART2() {
    LINE.serve();
}
