//! The direction of a buffered servo bus, in a log of the image: the board drives the bus while it sends, and listens otherwise.
//! The emulator sends a byte in no time, so it cannot show when the last stop bit leaves.

use crate::run::TaskResult;
use emulator::trace::TraceEvent;

/// USART2_DR.
const SERVO_DATA: u64 = 0x4000_4404;
/// PA1 high, PA1 low (RM0090, GPIOx_BSRR).
const TRANSMIT: u64 = 1 << 1;
const RECEIVE: u64 = 1 << 17;

/// Checks that each byte to the servos is sent while the board drives the bus, and that the board listens before it drives
/// again. The log may begin and end within a frame: bytes before the first change of direction are not checked.
pub(super) fn check(events: &[TraceEvent]) -> TaskResult {
    let (mut direction, mut sent, mut released) = (None, 0, 0);
    for event in events {
        match (event, direction) {
            (TraceEvent::SwitchedPortA(TRANSMIT), Some(TRANSMIT)) => Err("the bus is driven twice")?,
            (TraceEvent::SwitchedPortA(bits), _) => {
                released += usize::from(direction == Some(TRANSMIT) && *bits == RECEIVE);
                direction = Some(*bits);
            }
            (TraceEvent::Wrote(SERVO_DATA), Some(TRANSMIT)) => sent += 1,
            (TraceEvent::Wrote(SERVO_DATA), Some(_)) => Err("a byte is sent while the board listens")?,
            _ => {}
        }
    }
    match (sent, released) {
        (0, _) => Err("the log shows no direction and byte of the servo bus")?,
        (_, 0) => Err("the servo bus is never released")?,
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use TraceEvent::{SwitchedPortA, Wrote};

    #[test]
    fn bytes_are_sent_while_the_board_drives_the_bus() {
        let frame = [SwitchedPortA(TRANSMIT), Wrote(SERVO_DATA), Wrote(SERVO_DATA), SwitchedPortA(RECEIVE)];
        assert!(check(&frame).is_ok());
        assert!(check(&[&frame, frame.as_slice()].concat()).is_ok());
        assert!(check(&[&frame, &frame[..2]].concat()).is_ok(), "the log ends within a frame");
    }

    #[test]
    fn each_violation_is_noticed() {
        assert!(check(&[]).is_err(), "nothing is sent");
        assert!(check(&[SwitchedPortA(RECEIVE), Wrote(SERVO_DATA)]).is_err(), "listening");
        assert!(check(&[SwitchedPortA(TRANSMIT), Wrote(SERVO_DATA)]).is_err(), "never released");
        let twice = [SwitchedPortA(TRANSMIT), Wrote(SERVO_DATA), SwitchedPortA(TRANSMIT), Wrote(SERVO_DATA)];
        assert!(check(&twice).is_err(), "driven twice");
    }
}
