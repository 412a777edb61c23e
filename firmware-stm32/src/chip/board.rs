//! The reference board: pins, clocks, priorities and times. For other pins of the same USARTs, edit only this file.
//!
//! ```text
//!   PA9   USART1 TX ──▶ host          PC6   pump, high = on
//!   PA10  USART1 RX ◀── host          PC7   valve, high = open
//!   PA2   USART2 TX ◀─▶ servo bus     PC12  status LED, low = on
//!         (one wire, open drain)      OSC_IN, OSC_OUT: crystal
//!   PA1   direction of a buffered servo bus, high = the board drives
//! ```
//!
//! The Olimex STM32-H405 fits, and any other board with an STM32F405RG that has these pins on its headers.

use motion_core::TorqueCodes;
use protocol_core::time::Duration;

use super::gpio::{Active, GpioPort, Pin};
use crate::clock_rates::ClockSource;
use crate::crystal;

/// The crystals that may be fitted, in MHz, in rising order. The firmware measures which one it is. The measurement is
/// exact to some 4 %, so it cannot tell 24 or 26 MHz from 25: a board with one of these two lists it instead of 25.
pub const CRYSTALS_MHZ: &[u8] = &[8, 12, 16, 25];

const _: () = assert!(crystal::are_distinct(CRYSTALS_MHZ));

/// Host link, USART1.
pub const HOST_TRANSMIT: Pin = Pin::new(GpioPort::A, 9);
/// Host link, USART1.
pub const HOST_RECEIVE: Pin = Pin::new(GpioPort::A, 10);
/// Servo bus, USART2: one wire, open drain. The bus needs an external pull-up to 3.3 V.
pub const SERVO_BUS: Pin = Pin::new(GpioPort::A, 2);
/// The direction pin of a buffered servo bus, and its level while the board drives the bus. On a bus without a buffer, leave the
/// pin unconnected; `None` if it has another use.
pub const SERVO_DIRECTION: Option<(Pin, Active)> = Some((Pin::new(GpioPort::A, 1), Active::High));
/// Alternate function of the pins of USART1 and USART2 (DS8626, table 9).
pub const USART_FUNCTION: u8 = 7;
/// The servos' baud rate as delivered.
pub const SERVO_BAUD: u32 = 1_000_000;

/// Vacuum pump, on at the level [`VACUUM_ACTIVE`].
pub const PUMP: Pin = Pin::new(GpioPort::C, 6);
/// Valve that lets air into the cup.
pub const VALVE: Pin = Pin::new(GpioPort::C, 7);
/// Level that switches pump and valve on.
pub const VACUUM_ACTIVE: Active = Active::High;
/// Status LED: steady on without a fault, blinking while register 241 shows one.
pub const LED: Pin = Pin::new(GpioPort::C, 12);
/// Level that switches the LED on.
pub const LED_ACTIVE: Active = Active::Low;

/// The time that this many bytes take on the servo bus, in microseconds.
pub const fn servo_micros(bytes: u32) -> u32 {
    10_000_000 / SERVO_BAUD * bytes
}

/// Timeout of an answer. A servo as delivered waits 0.5 ms, then its longest answer takes 0.33 ms on the wire.
pub const SERVO_TIMEOUT: Duration = Duration::from_millis(3);

const _: () = assert!(
    SERVO_TIMEOUT.as_micros() >= 1_000 + servo_micros(LONGEST_ANSWER) as u64,
    "with this SERVO_BAUD the servos' answers come after SERVO_TIMEOUT"
);

/// Bytes of the longest answer of a servo: 27 registers from the torque switch on, and 6 bytes of framing.
const LONGEST_ANSWER: u32 = 33;
/// Timeout in the emulator, where bytes are late on a busy machine.
pub const SERVO_TIMEOUT_EMULATED: Duration = Duration::from_millis(50);
/// Idle time of the servo bus before each frame. A servo releases the line some microseconds after its last stop bit.
pub const SERVO_GUARD_TIME: Duration = Duration::from_micros(100);
/// Meaning of the torque switch codes of this arm's servos; `docs/bring-up.md` says how to determine it.
pub const TORQUE_CODES: TorqueCodes = TorqueCodes::DampingOnFree;
/// Servos on the bus: ids 0 to 6.
pub const SERVOS: u8 = 7;

/// Interrupt priority of the servo bus, in the upper four bits; 0 is the most urgent. The servo bus is the faster line: at
/// 1 Mbaud a byte has to be read within 10 microseconds.
pub const SERVO_PRIORITY: u8 = 1 << 4;
/// Interrupt priority of the host link.
pub const HOST_PRIORITY: u8 = 2 << 4;

/// Period of the watchdog: 1,000 counts of 64 cycles at 32 kHz are 2 s. The oscillator is between 17 and 47 kHz (DS8626,
/// table 36), so the shortest period is 1.36 s. The erase of a sector takes up to 0.8 s, and the watchdog is fed before
/// each.
pub const WATCHDOG_TURNS: u16 = 1_000;
/// A save waits until no byte was received, and none sent to the servos, for this long, in microseconds: longer than a servo waits
/// before it answers.
pub const SAVE_QUIET_MICROS: u32 = 1_000;
/// Longest wait before a save, in microseconds: half a control cycle.
pub const SAVE_TIMEOUT_MICROS: u32 = 5_000;

/// The chip id in the emulator.
pub const CHIP_ID_EMULATED: [u8; 6] = *b"\x7B\x07\x00\x00\x00\x01";

/// The chip id, registers 2 to 7 ([D8](protocol_core::decisions#d8)).
pub fn chip_id(source: ClockSource) -> [u8; 6] {
    match source {
        ClockSource::Emulated => CHIP_ID_EMULATED,
        _ => protocol_core::chip_id::reduce(unique_id()),
    }
}

/// The timeout of an answer, on the chip or in the emulator.
pub fn servo_timeout(source: ClockSource) -> Duration {
    if source == ClockSource::Emulated { SERVO_TIMEOUT_EMULATED } else { SERVO_TIMEOUT }
}

/// The unique id of the chip, 12 bytes in the order of their addresses (RM0090, section 39.1).
fn unique_id() -> [u8; 12] {
    const ADDRESS: *const [u8; 12] = 0x1FFF_7A10 as *const _;
    // SAFETY: every STM32F405 has this read-only memory. The emulator lacks it; `chip_id` does not call this there.
    unsafe { ADDRESS.read_volatile() }
}
