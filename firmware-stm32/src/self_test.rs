//! The self-test image, for the first power-up of a board. It has five steps and never drives a servo.
//!
//! ```text
//!   a  the board alone: LED, clock, supply, brown-out level, unique id
//!   b  the servo bus with its pull-up and without servos: 1,000 echoes
//!   c  one servo: 100 questions
//!   d  seven servos: their positions, repeated until the next command
//!   e  ways to crash: p panic, h hard fault, o stack overflow, w hang
//! ```
//!
//! Each step runs when its letter arrives on the host link, at 115,200 baud; step a also runs at start. Results go to the
//! host link as text, to the log, and to the LED (`led_pattern.rs`).
//!
//! No servo gets torque, even if the inrush current of the servos resets the board: the image has no controller, its servo
//! bus sends only questions (`question.rs`), and a crash damps the servos.

#![no_std]
#![no_main]

mod read_only_bus;
mod steps;

use cortex_m_rt::entry;
use defmt_rtt as _;
use firmware_stm32::chip::clock::{Clock, StartedClock};
use firmware_stm32::chip::outputs::Outputs;
use firmware_stm32::chip::watchdog::Watchdog;
use firmware_stm32::chip::{adc, board, clock, crash, gpio, host_link, mpu, servo_link};
use firmware_stm32::reset_cause::ResetCause;
use stm32f4::stm32f405 as pac;

use crate::read_only_bus::ReadOnlyBus;
use crate::steps::{Board, SelfTest};

/// Baud rate of the host link: the default of register 12.
const BAUD: u32 = 115_200;

#[entry]
fn main() -> ! {
    let (Some(chip), Some(mut core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take()) else {
        crash::restart(ResetCause::Unexpected);
    };
    gpio::enable(&chip.RCC);
    let outputs = Outputs::open();
    mpu::protect_stack(&core.MPU);
    let StartedClock { source, crystal_khz } =
        clock::start(&chip.RCC, &chip.FLASH, &chip.DBGMCU, &chip.TIM11);
    let rates = source.rates();
    clock::enable_peripherals(&chip.RCC);
    let clock = Clock::start(&chip.TIM2, core.SYST, rates);
    let servos = servo_link::open(chip.USART2, rates, &mut core.NVIC);
    let watchdog = Watchdog::start(chip.IWDG, &chip.DBGMCU);
    let (flags, cause) = crash::take_cause(&chip.RCC);
    let board = Board {
        source,
        crystal_khz,
        flags,
        cause,
        // BOR_LEV 0 is level 3, 3 is off (RM0090, FLASH_OPTCR).
        brown_out_level: 3 - (chip.FLASH.optcr().read().bor_lev().bits() & 3),
        calibration: adc::calibration(source),
        reference: adc::read_reference(&chip.RCC, &chip.ADC1, &chip.ADC_COMMON),
    };
    let timeout = u32::try_from(board::servo_timeout(source).as_micros()).unwrap_or(u32::MAX);
    SelfTest {
        board,
        clock,
        host: host_link::open(chip.USART1, rates, BAUD, &mut core.NVIC),
        servos: ReadOnlyBus::new(servos, timeout),
        led: outputs.led,
        watchdog,
        shown: (0, true),
    }
    .run()
}
