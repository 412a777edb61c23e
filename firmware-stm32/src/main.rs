//! A 7Bot V2 arm on an STM32F405: the same controller as in the simulator, with a chip round it.
//!
//! ```text
//!   host ══ USART1 ◀─ host_link ─▶ ┌────────────┐ ◀─ servo_link ─▶ USART2 ══ seven servos
//!                     clock ─────▶ │ Controller │ ──▶ gpio ──▶ pump, valve, LED
//!                  settings ◀────▶ └────────────┘
//! ```
//!
//! This file starts the chip and runs the loop; it knows nothing of what the bytes mean. The image that is
//! tested in the emulator is the image that is flashed: where it runs is found out at start, not at build.

#![no_std]
#![no_main]

mod bank;
mod board;
mod clock;
mod fault;
mod gpio;
mod host_link;
mod servo_link;
mod settings;
mod uart;

use core::convert::Infallible;

use cortex_m_rt::{entry, exception};
use defmt_rtt as _;
use embedded_io::{BufRead, Write};
use firmware_stm32::feeding::Feeding;
use firmware_stm32::flash::Flash;
use firmware_stm32::restart::{self, Ending};
use motion_core::{Config, Controller, Output, Vacuum};
use protocol_core::registers::map::{FAULTS, fault as fault_bit};
use protocol_core::time::Instant;
use stm32f4::stm32f405 as pac;

use crate::bank::Bank;
use crate::clock::Clock;
use crate::fault::Watchdog;
use crate::gpio::{Output as Pin, Switch};
use crate::host_link::HostLink;
use crate::servo_link::ServoLink;
use crate::settings::Settings;
use crate::uart::CHUNK;

/// Half a period of the LED where there is a fault to tell, in microseconds.
const BLINK_MICROS: u64 = 250_000;

/// What stands round the controller.
struct Shell<'a> {
    clock: Clock,
    host: HostLink,
    servos: ServoLink,
    settings: Settings<'a>,
    pump: Switch<Pin>,
    valve: Switch<Pin>,
    led: Switch<Pin>,
    watchdog: &'a Watchdog,
    feeding: Feeding,
}

#[entry]
fn main() -> ! {
    let (Some(chip), Some(mut core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take()) else {
        fault::restart(Ending::Unexpected);
    };
    let source = clock::start(&chip.RCC, &chip.FLASH, &chip.DBGMCU);
    let rates = source.rates();
    enable_peripherals(&chip.RCC);
    let mut clock = Clock::start(&chip.TIM2, core.SYST, rates);
    // First of all the line on which the servos can be told to let go.
    let servos = servo_link::open(chip.USART2, rates, &mut core.NVIC);
    let watchdog = Watchdog::start(chip.IWDG, &chip.DBGMCU);
    let faults = source.faults() | restart_faults(&chip.RCC);

    let settings = Settings::open(Flash(Bank::new(chip.FLASH, chip.PWR, &watchdog)));
    let config = Config {
        chip_id: board::chip_id(source),
        faults,
        servo_timeout: board::servo_timeout(source),
        torque_codes: board::TORQUE_CODES,
    };
    let controller = Controller::new(clock.now(), config, settings.found(), settings.storage());
    let host = host_link::open(chip.USART1, rates, controller.baud(), &mut core.NVIC);
    defmt::info!("ready: clock {}, faults {=u8:#b}, {=u32} baud", source, faults, controller.baud());
    let shell = Shell {
        clock,
        host,
        servos,
        settings,
        pump: board::PUMP.into_switch(board::VACUUM_ACTIVE),
        valve: board::VALVE.into_switch(board::VACUUM_ACTIVE),
        led: board::LED.into_switch(board::LED_ACTIVE),
        watchdog: &watchdog,
        feeding: Feeding::new(),
    };
    shell.run(controller)
}

impl Shell<'_> {
    fn run(mut self, mut arm: Controller) -> ! {
        loop {
            let now = self.clock.now();
            self.receive(now, &mut arm);
            let until = self.act(now, &mut arm);
            if self.host.take_overrun() {
                arm.raise_faults(fault_bit::RECEIVE_OVERRUN);
            }
            self.watchdog.feed_if_due(&mut self.feeding);
            self.show(now, &arm);
            self.sleep(until, arm.host_bytes_wanted());
        }
    }

    /// Does what is to be done at `now`, and says when there will be more.
    fn act(&mut self, now: Instant, arm: &mut Controller) -> Instant {
        loop {
            match arm.poll(now, self.host.room()) {
                Output::ToHost(bytes) => send(&mut self.host, bytes),
                Output::ToServos(bytes) => {
                    send(&mut self.servos, bytes);
                    self.feeding.control_cycle_ran();
                }
                Output::Vacuum(vacuum) => self.switch(vacuum),
                Output::Save(image) => {
                    arm.set_storage(self.settings.save(image));
                    // That took its time.
                    return now;
                }
                Output::Wait(until) => return until,
            }
        }
    }

    fn receive(&mut self, now: Instant, arm: &mut Controller) {
        loop {
            let bytes = self.host.received();
            let taken = arm.host_bytes(now, bytes);
            if taken > 0 || bytes.is_empty() {
                self.feeding.host_link_ran();
            }
            self.host.consume(taken);
            // Less than a whole chunk: nothing more waits, or the controller takes no more.
            if taken < CHUNK {
                break;
            }
        }
        loop {
            let bytes = self.servos.received();
            let count = bytes.len();
            if count == 0 {
                break;
            }
            arm.servo_bytes(bytes);
            self.servos.consume(count);
        }
    }

    fn switch(&mut self, vacuum: Vacuum) {
        self.pump.set(vacuum.pump);
        self.valve.set(vacuum.valve);
        defmt::info!("{}", vacuum);
    }

    /// Steady light: all is well. Blinking: the status block has a fault to tell.
    fn show(&mut self, now: Instant, arm: &Controller) {
        let well = arm.registers().get(FAULTS.address) == 0;
        self.led.set(well || (now.as_micros() / BLINK_MICROS).is_multiple_of(2));
    }

    /// Sleeps until bytes come that make a difference, or the system timer ticks: an interrupt that brings less, or
    /// sends, is not worth a turn of the loop. Of the bytes that are wanted, the last one finds the others taken in.
    fn sleep(&mut self, until: Instant, wanted: usize) {
        let enough = wanted.saturating_sub(1).max(1);
        let _ = self.clock.has_ticked();
        if self.clock.now() >= until {
            return;
        }
        loop {
            // With interrupts shut out, one that comes between the look and the sleep ends the sleep.
            let is_over = critical_section::with(|_| {
                let is_over =
                    self.clock.has_ticked() || self.servos.has_received() || self.host.waiting() >= enough;
                if !is_over {
                    cortex_m::asm::wfi();
                }
                is_over
            });
            if is_over {
                return;
            }
        }
    }
}

/// The queue has room: the controller was told how much, and the servo bus is idle before each frame.
fn send(line: &mut impl Write<Error = Infallible>, bytes: &[u8]) {
    let Ok(()) = line.write_all(bytes);
}

fn enable_peripherals(rcc: &pac::RCC) {
    rcc.ahb1enr().modify(|_, w| w.gpioaen().enabled().gpioben().enabled().gpiocen().enabled());
    rcc.apb1enr().modify(|_, w| w.tim2en().enabled().usart2en().enabled().pwren().enabled());
    rcc.apb2enr().modify(|_, w| w.usart1en().enabled());
}

/// Why the chip started. Telling clears the chip's flags, or the next start would see them again.
fn restart_faults(rcc: &pac::RCC) -> u8 {
    let flags = rcc.csr().read().bits();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    let ending = fault::take_ending();
    defmt::info!("start: RCC_CSR {=u32:#010x}, last run ended in {}", flags, ending);
    restart::faults(flags, ending)
}

/// Wakes the core, no more: ticks are not counted.
#[exception]
fn SysTick() {}
