//! The clock tree and the time.
//!
//! ```text
//!   crystal ──▶ PLL ──▶ 168 MHz        the crystal fails, or is none of the board's: PLL from the internal oscillator
//!                                      the PLL fails: the internal oscillator, 16 MHz
//!                                      none of the three is ready: the emulator, which has no clock tree
//! ```
//!
//! Time is the count of TIM2, free running at 1 MHz. The system timer only wakes the core, each millisecond or sooner. It
//! does not measure time, because the emulator loses some of its ticks.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;
use protocol_core::time::{Duration, Instant};
use stm32f4::stm32f405 as pac;

use super::board;
use crate::clock_rates::{self, ClockRates, ClockSource};
use crate::crystal;
use crate::tick;
use crate::timeline::Timeline;
use crate::wait::wait_for;

/// Limit on the polls for a clock to become ready: some 0.1 s, because the core runs on the internal oscillator meanwhile.
/// A crystal takes a few milliseconds (DS8626, table 33).
const READY_POLLS: u32 = 200_000;
/// Limit on the polls for a capture of the crystal. With the slowest crystal, 4 MHz, a capture takes 62 us: 1,000 cycles of
/// the core.
const CAPTURE_POLLS: u32 = 2_000;
/// Frequency of the internal oscillator, in MHz.
const INTERNAL_MHZ: u8 = 16;

const _: () = assert!(clock_rates::INTERNAL_HZ == INTERNAL_MHZ as u32 * 1_000_000);

/// The result of [`start`].
#[derive(Clone, Copy)]
pub struct StartedClock {
    /// The source of the core clock.
    pub source: ClockSource,
    /// The crystal as measured against the internal oscillator; `None` if it did not start or could not be measured, and in the
    /// emulator.
    pub crystal_khz: Option<u32>,
}

/// Starts the best clock that works, and keeps the debug port clocked while the core sleeps. After a reset the chip runs on
/// its internal oscillator.
pub fn start(rcc: &pac::RCC, flash: &pac::FLASH, dbgmcu: &pac::DBGMCU, timer: &pac::TIM11) -> StartedClock {
    // Without DBG_SLEEP, WFI also stops the clock of the debug port, and no probe can attach to a sleeping chip
    // (RM0090, DBGMCU_CR). A probe clears the bit when it detaches; a reset does not.
    dbgmcu.cr().modify(|_, w| w.dbg_sleep().set_bit());
    if is_emulated(rcc, dbgmcu) {
        return StartedClock { source: ClockSource::Emulated, crystal_khz: None };
    }
    rcc.cr().modify(|_, w| w.hseon().on());
    let is_ready = wait_for(READY_POLLS, || rcc.cr().read().hserdy().is_ready());
    let crystal_khz = if is_ready { measure_crystal(rcc, timer) } else { None };
    let source = select(rcc, flash, crystal_khz.and_then(|khz| crystal::identify(khz, board::CRYSTALS_MHZ)));
    StartedClock { source, crystal_khz }
}

/// Switches to the best clock that works. `crystal_mhz` is one of the board's crystals; `None` if no crystal can be
/// used.
fn select(rcc: &pac::RCC, flash: &pac::FLASH, crystal_mhz: Option<u8>) -> ClockSource {
    if let Some(mhz) = crystal_mhz
        && lock_pll(rcc, mhz, true)
        && switch_to_pll(rcc, flash)
    {
        // From now on a crystal that stops raises an NMI (RM0090, section 7.2.7), which restarts the chip.
        rcc.cr().modify(|_, w| w.csson().on());
        return ClockSource::Crystal;
    }
    rcc.cr().modify(|_, w| w.hseon().off());
    if lock_pll(rcc, INTERNAL_MHZ, false) && switch_to_pll(rcc, flash) {
        return ClockSource::InternalPll;
    }
    rcc.cr().modify(|_, w| w.pllon().off());
    ClockSource::Internal
}

/// Measures the crystal with TIM11, in kHz. The internal oscillator clocks the core and the timer meanwhile (RM0090, section
/// 7.2.11). `None` if a capture does not come in time, if one was missed, or if the count stands still.
fn measure_crystal(rcc: &pac::RCC, timer: &pac::TIM11) -> Option<u32> {
    // SAFETY: 31 is the largest of the dividers 2 to 31 (RM0090, RCC_CFGR).
    rcc.cfgr().modify(|_, w| unsafe { w.rtcpre().bits(crystal::DIVIDER) });
    rcc.apb2enr().modify(|_, w| w.tim11en().enabled());
    let _ = rcc.apb2enr().read();
    // SAFETY: 2 is a value of the field: input 1 is the divided crystal (RM0090, TIM11_OR).
    timer.or().write(|w| unsafe { w.rmp().bits(0b10) });
    timer.arr().write(|w| w.arr().set(u16::MAX));
    // Capture each eighth rising edge of input 1.
    timer.ccmr1_input().write(|w| w.cc1s().ti1().ic1psc().set(0b11));
    timer.ccer().write(|w| w.cc1e().set_bit());
    timer.cr1().write(|w| w.cen().enabled());
    let khz = crystal::measure_khz(|| next_capture(timer));
    rcc.apb2enr().modify(|_, w| w.tim11en().disabled());
    khz
}

/// The next captured count; `None` if none comes, or if one was missed.
fn next_capture(timer: &pac::TIM11) -> Option<u16> {
    if !wait_for(CAPTURE_POLLS, || timer.sr().read().cc1if().bit_is_set()) {
        return None;
    }
    // Reading the count clears CC1IF. CC1OF shows a capture that was overwritten.
    let count = timer.ccr1().read().ccr().bits();
    (!timer.sr().read().cc1of().bit_is_set()).then_some(count)
}

/// True in the emulator. On the chip the internal oscillator is ready at the first instruction, and the id is never 0.
fn is_emulated(rcc: &pac::RCC, dbgmcu: &pac::DBGMCU) -> bool {
    let cr = rcc.cr().read();
    cr.hsirdy().is_not_ready()
        && cr.hserdy().is_not_ready()
        && cr.pllrdy().is_not_ready()
        && dbgmcu.idcode().read().bits() == 0
}

/// Locks the PLL at 1 MHz x 336 / 2 = 168 MHz. Returns false if it does not stop before, or does not lock. An input of 1 MHz
/// serves every crystal of whole megahertz; the 2 MHz that RM0090 recommends would give less jitter, but exclude a crystal of
/// 25 MHz.
fn lock_pll(rcc: &pac::RCC, input_mhz: u8, from_crystal: bool) -> bool {
    rcc.cr().modify(|_, w| w.pllon().off());
    if !wait_for(READY_POLLS, || rcc.cr().read().pllrdy().is_not_ready()) {
        return false;
    }
    rcc.pllcfgr().write(|w| {
        // SAFETY: all values are in range (RM0090, section 7.3.2). M is 4 to 26 in 2..63, N is 336 in 50..432.
        // Q is 7 in 2..15; its output is not used.
        unsafe { w.pllm().bits(input_mhz).plln().bits(336).pllq().bits(7) };
        w.pllp().div2().pllsrc().bit(from_crystal)
    });
    rcc.cr().modify(|_, w| w.pllon().on());
    wait_for(READY_POLLS, || rcc.cr().read().pllrdy().is_ready())
}

/// Sets wait states and bus dividers for 168 MHz, then switches to the PLL. Returns false if the switch fails.
fn switch_to_pll(rcc: &pac::RCC, flash: &pac::FLASH) -> bool {
    // Five wait states are enough above 2.7 V (RM0090, table 10). Prefetch stays off: it fails in the first revision of
    // the chip (errata ES0182, section 2.1.12), and the caches make up for most of its effect.
    flash.acr().write(|w| w.latency().ws5().icen().enabled().dcen().enabled());
    if !wait_for(READY_POLLS, || flash.acr().read().latency().is_ws5()) {
        return false;
    }
    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div4().ppre2().div2());
    rcc.cfgr().modify(|_, w| w.sw().pll());
    let switched = wait_for(READY_POLLS, || rcc.cfgr().read().sws().is_pll());
    if !switched {
        rcc.cfgr().modify(|_, w| w.sw().hsi().ppre1().div1().ppre2().div1());
    }
    switched
}

/// Enables the clocks of TIM2, PWR and the USARTs. The reads give them the delay that they need before the first access (errata
/// ES0182, delay after an RCC peripheral clock enabling).
pub fn enable_peripherals(rcc: &pac::RCC) {
    rcc.apb1enr().modify(|_, w| w.tim2en().enabled().usart2en().enabled().pwren().enabled());
    let _ = rcc.apb1enr().read();
    rcc.apb2enr().modify(|_, w| w.usart1en().enabled());
    let _ = rcc.apb2enr().read();
}

/// Set by each tick of the system timer.
static TICKED: AtomicBool = AtomicBool::new(false);
/// Reload value to restore after a short tick; 0 if no short tick is running.
static FULL_TICK: AtomicU32 = AtomicU32::new(0);

/// The time since start, and the system timer that wakes the core.
pub struct Clock {
    timeline: Timeline,
    ticker: SYST,
    cycles_per_micro: u32,
}

impl Clock {
    /// Starts TIM2 and the system timer.
    pub fn start(timer: &pac::TIM2, mut ticker: SYST, rates: ClockRates) -> Self {
        timer.psc().write(|w| w.psc().set(clock_rates::microsecond_prescaler(rates.timer)));
        // After a reset ARR is 0 according to the manual (RM0090, section 18.4.12), and the counter would stand still.
        timer.arr().write(|w| w.arr().set(u32::MAX));
        // An update event loads the prescaler and clears the count.
        timer.egr().write(|w| w.ug().update());
        timer.cr1().write(|w| w.cen().enabled());
        ticker.set_clock_source(SystClkSource::Core);
        ticker.set_reload(reload(rates.core / 1_000_000));
        ticker.clear_current();
        ticker.enable_counter();
        ticker.enable_interrupt();
        Self { timeline: Timeline::new(), ticker, cycles_per_micro: rates.core / 1_000_000 }
    }

    /// Makes the next tick come within `wait`. The ticks after it have the usual period.
    pub fn tick_within(&mut self, wait: Duration) {
        if let Some(cycles) = tick::cycles(wait, self.cycles_per_micro)
            && cycles < SYST::get_current()
        {
            // A tick between these writes would restore the usual period too early, and the short period would stay.
            cortex_m::interrupt::free(|_| {
                FULL_TICK.store(reload(self.cycles_per_micro), Ordering::Relaxed);
                self.ticker.set_reload(cycles.max(1));
                self.ticker.clear_current();
            });
        }
    }

    /// True if the system timer has ticked since the last call.
    pub fn has_ticked(&mut self) -> bool {
        // Load and store cost less than a swap. A tick between them is not lost: the call returns true anyway.
        let ticked = TICKED.load(Ordering::Relaxed);
        if ticked {
            TICKED.store(false, Ordering::Relaxed);
        }
        ticked
    }

    /// The time since start.
    pub fn now(&mut self) -> Instant {
        self.timeline.extend(micros())
    }
}

/// Reload value of the system timer: the cycles of a tick less one.
const fn reload(cycles_per_micro: u32) -> u32 {
    cycles_per_micro * tick::TICK_MICROS - 1
}

/// Wakes the core. After a short tick it restores the usual period.
#[exception]
fn SysTick() {
    TICKED.store(true, Ordering::Relaxed);
    let full = FULL_TICK.load(Ordering::Relaxed);
    if full != 0 {
        FULL_TICK.store(0, Ordering::Relaxed);
        // SAFETY: `tick_within` writes the same registers, with interrupts masked.
        unsafe {
            let timer = &*SYST::PTR;
            timer.rvr.write(full);
            timer.cvr.write(0);
        }
    }
}

/// The count of TIM2 in microseconds. It wraps every 71 minutes.
pub fn micros() -> u32 {
    // SAFETY: reading the count of a timer has no side effect.
    unsafe { pac::TIM2::steal() }.cnt().read().bits()
}

defmt::timestamp!("{=u32:us}", micros());
