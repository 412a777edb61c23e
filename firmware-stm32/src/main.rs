//! The firmware: the same controller as in the simulator, and the drivers that connect it to the hardware of an STM32F405.
//!
//! ```text
//!   host ══ USART1 ◀─ host_link ─▶ ┌────────────┐ ◀─ servo_link ─▶ USART2 ══ seven servos
//!                     clock ─────▶ │ Controller │ ──▶ gpio ──▶ pump, valve, LED
//!                  settings ◀────▶ └────────────┘
//! ```
//!
//! This file starts the chip; `main_loop.rs` runs the controller. One image runs on the chip and in the emulator: it
//! detects at start where it runs (`clock::start`).

#![no_std]
#![no_main]

mod log;
mod main_loop;

use cortex_m_rt::entry;
use defmt_rtt as _;
use firmware_stm32::chip::clock::{Clock, StartedClock};
use firmware_stm32::chip::flash_registers::ChipFlashRegisters;
use firmware_stm32::chip::outputs::Outputs;
use firmware_stm32::chip::watchdog::Watchdog;
use firmware_stm32::chip::{board, clock, crash, gpio, host_link, mpu, servo_link};
use firmware_stm32::flash::Flash;
use firmware_stm32::reset_cause::{self, ResetCause};
use firmware_stm32::watchdog_gate::WatchdogGate;
use motion_core::{Config, Controller};
use protocol_core::settings::Settings;
use stm32f4::stm32f405 as pac;

use crate::log::Log;
use crate::main_loop::MainLoop;

/// The version in the log. `cargo xtask dist` sets `SEVENBOT_RELEASE`, which adds the commit.
const VERSION: &str = match option_env!("SEVENBOT_RELEASE") {
    Some(release) => release,
    None => env!("CARGO_PKG_VERSION"),
};

#[entry]
fn main() -> ! {
    let (Some(chip), Some(mut core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take()) else {
        crash::restart(ResetCause::Unexpected);
    };
    // Pump and valve first: their pins are inputs until then, and the clocks may take some 0.1 s to start.
    gpio::enable(&chip.RCC);
    let outputs = Outputs::open();
    mpu::protect_stack(&core.MPU);
    let StartedClock { source, crystal_khz } =
        clock::start(&chip.RCC, &chip.FLASH, &chip.DBGMCU, &chip.TIM11);
    let rates = source.rates();
    clock::enable_peripherals(&chip.RCC);
    let mut clock = Clock::start(&chip.TIM2, core.SYST, rates);
    // Then the servo bus, because the crash handler needs it to damp the servos.
    let servos = servo_link::open(chip.USART2, rates, &mut core.NVIC);
    let watchdog = Watchdog::start(chip.IWDG, &chip.DBGMCU);
    let (flags, cause) = crash::take_cause(&chip.RCC);
    let faults = source.faults() | reset_cause::faults(flags, cause);

    let settings = Settings::open(Flash::new(ChipFlashRegisters::new(chip.FLASH, chip.PWR, &watchdog)));
    defmt::info!("settings: {}, room for {=usize}", settings.opened(), settings.room());
    let config = Config {
        chip_id: board::chip_id(source),
        faults,
        servo_baud: board::SERVO_BAUD,
        servo_timeout: board::servo_timeout(source),
        guard_time: board::SERVO_GUARD_TIME,
        torque_codes: board::TORQUE_CODES,
    };
    let controller = Controller::new(clock.now(), config, settings.found(), settings.storage());
    // Before the host link is open: a log line masks the interrupts for longer than a byte may wait.
    defmt::info!("version {=str}", VERSION);
    defmt::info!("ready: clock {}, crystal {} kHz", source, crystal_khz);
    defmt::info!("faults {=u8:#b}, {=u32} baud", faults, controller.baud());
    let host = host_link::open(chip.USART1, rates, controller.baud(), &mut core.NVIC);
    let main_loop = MainLoop {
        clock,
        host,
        servos,
        settings,
        outputs,
        watchdog: &watchdog,
        watchdog_gate: WatchdogGate::new(),
        log: Log::new(),
    };
    main_loop.run(controller)
}
