//! The reference board: pins, clocks, priorities and times. Other wiring is an edit of this file only.
//!
//! ```text
//!   PA9   USART1 TX ──▶ host          PC6   pump, high = on
//!   PA10  USART1 RX ◀── host          PC7   valve, high = open
//!   PA2   USART2 TX ◀─▶ servo bus     PC12  status LED, low = on
//!         (one wire, open drain)      OSC_IN, OSC_OUT: 8 MHz crystal
//! ```
//!
//! The Olimex STM32-H405 fits, and any other board with an STM32F405RG that has these pins on its headers.

use firmware_stm32::clock_rates::ClockSource;
use motion_core::TorqueCodes;
use protocol_core::time::Duration;

use crate::gpio::{Active, GpioPort, Pin};

/// The crystal, in Hz: a multiple of the 2 MHz at the input of the PLL.
pub(crate) const CRYSTAL_HZ: u32 = 8_000_000;

/// Host link, USART1.
pub(crate) const HOST_TRANSMIT: Pin = Pin::new(GpioPort::A, 9);
/// Host link, USART1.
pub(crate) const HOST_RECEIVE: Pin = Pin::new(GpioPort::A, 10);
/// Servo bus, USART2: one wire, open drain. The bus needs an external pull-up to 3.3 V.
pub(crate) const SERVO_BUS: Pin = Pin::new(GpioPort::A, 2);
/// Alternate function of the pins above: USART1 and USART2 (DS8626, table 9).
pub(crate) const USART_FUNCTION: u8 = 7;
/// The servos' baud rate as delivered.
pub(crate) const SERVO_BAUD: u32 = 1_000_000;

/// Vacuum pump.
pub(crate) const PUMP: Pin = Pin::new(GpioPort::C, 6);
/// Valve that lets air into the cup.
pub(crate) const VALVE: Pin = Pin::new(GpioPort::C, 7);
/// Level that switches pump and valve on.
pub(crate) const VACUUM_ACTIVE: Active = Active::High;
/// Status LED: steady on without a fault, blinking while register 241 shows one.
pub(crate) const LED: Pin = Pin::new(GpioPort::C, 12);
/// Level that switches the LED on.
pub(crate) const LED_ACTIVE: Active = Active::Low;

/// Timeout of an answer. A servo as delivered waits 0.5 ms, then its longest answer takes 0.21 ms on the wire.
pub(crate) const SERVO_TIMEOUT: Duration = Duration::from_millis(3);
/// Timeout in the emulator, where bytes are late on a busy machine.
pub(crate) const SERVO_TIMEOUT_EMULATED: Duration = Duration::from_millis(50);
/// Idle time of the servo bus before each frame. A servo releases the line some microseconds after its last stop bit.
pub(crate) const SERVO_GUARD_TIME: Duration = Duration::from_micros(100);
/// Meaning of the torque switch codes of this arm's servos; `docs/bring-up.md` says how to determine it.
pub(crate) const TORQUE_CODES: TorqueCodes = TorqueCodes::DampingOnFree;
/// Servos on the bus: ids 0 to 6.
pub(crate) const SERVOS: u8 = 7;

/// Interrupt priority of the servo bus, in the upper four bits; 0 is the most urgent. The servo bus is the faster line: at
/// 1 Mbaud a byte has to be read within 10 microseconds.
pub(crate) const SERVO_PRIORITY: u8 = 1 << 4;
/// Interrupt priority of the host link.
pub(crate) const HOST_PRIORITY: u8 = 2 << 4;

/// Period of the watchdog: 1,000 counts of 64 cycles at 32 kHz are 2 s. The oscillator is between 17 and 47 kHz (DS8626,
/// table 36), so the shortest period is 1.36 s. The erase of a sector takes up to 0.8 s, and the watchdog is fed before
/// each.
pub(crate) const WATCHDOG_TURNS: u16 = 1_000;
/// A save waits until both lines are quiet for this long, in microseconds: longer than a servo waits before it answers.
pub(crate) const SAVE_QUIET_MICROS: u32 = 1_000;
/// Longest wait before a save, in microseconds: half a control cycle.
pub(crate) const SAVE_TIMEOUT_MICROS: u32 = 5_000;

/// The chip id in the emulator.
pub(crate) const CHIP_ID_EMULATED: [u8; 6] = *b"\x7B\x07\x00\x00\x00\x01";

/// The id of this chip (D8).
pub(crate) fn chip_id(source: ClockSource) -> [u8; 6] {
    match source {
        ClockSource::Emulated => CHIP_ID_EMULATED,
        _ => protocol_core::chip_id::reduce(unique_id()),
    }
}

/// The timeout of an answer, on the chip or in the emulator.
pub(crate) fn servo_timeout(source: ClockSource) -> Duration {
    if source == ClockSource::Emulated { SERVO_TIMEOUT_EMULATED } else { SERVO_TIMEOUT }
}

/// The unique id of the chip, 12 bytes in the order of their addresses (RM0090, section 39.1).
fn unique_id() -> [u8; 12] {
    const ADDRESS: *const [u8; 12] = 0x1FFF_7A10 as *const _;
    // SAFETY: every STM32F405 has this read-only memory. The emulator lacks it; `chip_id` does not call this there.
    unsafe { ADDRESS.read_volatile() }
}
