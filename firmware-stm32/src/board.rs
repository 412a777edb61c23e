//! The reference board in one table: pins, clocks, priorities, times. An arm with other wiring edits this
//! file and no other.
//!
//! ```text
//!   PA9   USART1 TX ──▶ host          PC6   pump, high = on
//!   PA10  USART1 RX ◀── host          PC7   valve, high = open
//!   PA2   USART2 TX ◀─▶ servo bus     PC12  status LED, low = on
//!         (one wire, 5 V tolerant)    OSC_IN, OSC_OUT: 8 MHz crystal
//! ```
//!
//! That is an Olimex STM32-H405 or any other board with an STM32F405RG that brings these pins out.

use firmware_stm32::rates::Source;
use motion_core::TorqueCodes;
use protocol_core::time::Duration;

use crate::gpio::{Active, Pin, Port};

/// The crystal, in Hz: a whole number of 2 MHz, which is what the PLL is fed with.
pub(crate) const CRYSTAL_HZ: u32 = 8_000_000;

/// Host link, USART1.
pub(crate) const HOST_TRANSMIT: Pin = Pin::new(Port::A, 9);
/// Host link, USART1.
pub(crate) const HOST_RECEIVE: Pin = Pin::new(Port::A, 10);
/// Servo bus, USART2: one wire, driven open drain. The bus needs a pull-up.
pub(crate) const SERVO_BUS: Pin = Pin::new(Port::A, 2);
/// Alternate function of the pins above: USART1 and USART2 (datasheet DS8626, table 9).
pub(crate) const USART_FUNCTION: u8 = 7;
/// The servos' own rate as delivered, in bits per second.
pub(crate) const SERVO_BAUD: u32 = 1_000_000;

/// Vacuum pump.
pub(crate) const PUMP: Pin = Pin::new(Port::C, 6);
/// Valve that lets air into the cup.
pub(crate) const VALVE: Pin = Pin::new(Port::C, 7);
/// Level that switches pump and valve on.
pub(crate) const VACUUM_ACTIVE: Active = Active::High;
/// Status LED: on while the firmware runs and has no fault to tell.
pub(crate) const LED: Pin = Pin::new(Port::C, 12);
/// Level that switches the LED on.
pub(crate) const LED_ACTIVE: Active = Active::Low;

/// How long a servo may take to answer. Its answer to the longest read takes 0.21 ms on the wire, and it
/// waits 0.5 ms before as delivered.
pub(crate) const SERVO_TIMEOUT: Duration = Duration::from_millis(3);
/// The same in the emulator, where a byte takes as long as the machine below is busy.
pub(crate) const SERVO_TIMEOUT_EMULATED: Duration = Duration::from_millis(50);
/// What the torque switch of this arm's servos means; `docs/bring-up.md` says how to find out.
pub(crate) const TORQUE_CODES: TorqueCodes = TorqueCodes::DampingOnFree;
/// Servos on the bus: ids 0 to 6.
pub(crate) const SERVOS: u8 = 7;

/// Interrupt priorities, 0 the most urgent, in the four bits that the chip has. The servo bus is the
/// faster of the two lines: at 1 Mbaud a byte has to be fetched within 10 microseconds.
pub(crate) const SERVO_PRIORITY: u8 = 1 << 4;
/// See above.
pub(crate) const HOST_PRIORITY: u8 = 2 << 4;

/// Turns of the watchdog's counter, each 64 cycles of the 32 kHz oscillator: 2 s. That oscillator is
/// anywhere between 17 and 47 kHz (DS8626, table 36), so the shortest is 1.36 s: more than the 0.8 s that
/// the erase of a sector may take, and the watchdog is fed before each.
pub(crate) const WATCHDOG_TURNS: u16 = 1_000;
/// How often the core wakes at the latest, per second.
pub(crate) const WAKE_HZ: u32 = 1_000;

/// What stands for the chip id where there is no chip.
pub(crate) const CHIP_ID_EMULATED: [u8; 6] = *b"\x7B\x07\x00\x00\x00\x01";

/// The number of this chip (D8).
pub(crate) fn chip_id(source: Source) -> [u8; 6] {
    match source {
        Source::Emulated => CHIP_ID_EMULATED,
        _ => protocol_core::chip_id::reduce(unique_id()),
    }
}

/// How long a servo may take, here.
pub(crate) fn servo_timeout(source: Source) -> Duration {
    if source == Source::Emulated { SERVO_TIMEOUT_EMULATED } else { SERVO_TIMEOUT }
}

/// The unique id of the chip, 12 bytes in the order of their addresses (RM0090, section 39.1).
fn unique_id() -> [u8; 12] {
    const ADDRESS: *const [u8; 12] = 0x1FFF_7A10 as *const _;
    // SAFETY: read-only memory of every STM32F405; whoever has none (the emulator) does not come here.
    unsafe { ADDRESS.read_volatile() }
}
