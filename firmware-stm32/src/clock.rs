//! What time it is, and how fast the chip runs.
//!
//! ```text
//!   crystal ──▶ PLL ──▶ 168 MHz        dead crystal: PLL from the internal oscillator
//!                                      dead PLL: the internal oscillator, 16 MHz
//!                                      none of the three: the emulator, which has no clock tree
//! ```
//!
//! Time is the count of TIM2, 1 MHz, free running. The system timer only wakes the core: in the emulator it
//! loses ticks, and nothing counts them.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use firmware_stm32::rates::{self, Rates, Source};
use firmware_stm32::timeline::Timeline;
use protocol_core::time::Instant;
use stm32f4::stm32f405 as pac;

use crate::board;

/// Looks at a flag before it counts as never coming: some 0.1 s on the internal oscillator, which the core
/// runs on then. A crystal takes a few milliseconds (datasheet DS8626, table 33).
const PATIENCE: u32 = 200_000;
/// The input of the PLL, in Hz (RM0090, section 7.3.2 recommends 2 MHz).
const PLL_INPUT_HZ: u32 = 2_000_000;

const _: () = assert!(board::CRYSTAL_HZ.is_multiple_of(PLL_INPUT_HZ) && board::CRYSTAL_HZ <= 26_000_000);

/// Starts the best clock there is. The chip has just been reset: it runs on its internal oscillator.
pub(crate) fn start(rcc: &pac::RCC, flash: &pac::FLASH, dbgmcu: &pac::DBGMCU) -> Source {
    if is_emulated(rcc, dbgmcu) {
        return Source::Emulated;
    }
    rcc.cr().modify(|_, w| w.hseon().on());
    let crystal = comes_true(|| rcc.cr().read().hserdy().is_ready());
    if crystal && lock_pll(rcc, board::CRYSTAL_HZ, true) && switch_to_pll(rcc, flash) {
        // From now on a crystal that stops is an NMI (RM0090, section 7.2.7), which ends in a restart.
        rcc.cr().modify(|_, w| w.csson().on());
        return Source::Crystal;
    }
    rcc.cr().modify(|_, w| w.hseon().off());
    if lock_pll(rcc, rates::INTERNAL_HZ, false) && switch_to_pll(rcc, flash) {
        return Source::InternalPll;
    }
    rcc.cr().modify(|_, w| w.pllon().off());
    Source::Internal
}

/// On the chip the internal oscillator is ready when the first instruction runs, and the id is never 0.
fn is_emulated(rcc: &pac::RCC, dbgmcu: &pac::DBGMCU) -> bool {
    let cr = rcc.cr().read();
    cr.hsirdy().is_not_ready()
        && cr.hserdy().is_not_ready()
        && cr.pllrdy().is_not_ready()
        && dbgmcu.idcode().read().bits() == 0
}

/// 2 MHz x 168 / 2 = 168 MHz.
fn lock_pll(rcc: &pac::RCC, input_hz: u32, from_crystal: bool) -> bool {
    let [divisor, ..] = (input_hz / PLL_INPUT_HZ).to_le_bytes();
    rcc.cr().modify(|_, w| w.pllon().off());
    if !comes_true(|| rcc.cr().read().pllrdy().is_not_ready()) {
        return false;
    }
    rcc.pllcfgr().write(|w| {
        // SAFETY: 8 / 2 to 26 / 2 and 168 are within what the PLL takes (RM0090, section 7.3.2): 2..63 and
        // 50..432; 7 is the reset value of an output that nobody uses here, which may be 2..15.
        unsafe { w.pllm().bits(divisor).plln().bits(168).pllq().bits(7) };
        w.pllp().div2().pllsrc().bit(from_crystal)
    });
    rcc.cr().modify(|_, w| w.pllon().on());
    comes_true(|| rcc.cr().read().pllrdy().is_ready())
}

/// Slows the flash and the peripheral buses down for 168 MHz, then switches over.
fn switch_to_pll(rcc: &pac::RCC, flash: &pac::FLASH) -> bool {
    // Five wait states from 2.7 V on (RM0090, table 10). No prefetch: the first revision of the chip
    // cannot (errata ES0182, section 2.1.12), and the caches make up for most of it.
    flash.acr().write(|w| w.latency().ws5().icen().enabled().dcen().enabled());
    if !comes_true(|| flash.acr().read().latency().is_ws5()) {
        return false;
    }
    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div4().ppre2().div2());
    rcc.cfgr().modify(|_, w| w.sw().pll());
    let switched = comes_true(|| rcc.cfgr().read().sws().is_pll());
    if !switched {
        rcc.cfgr().modify(|_, w| w.sw().hsi().ppre1().div1().ppre2().div1());
    }
    switched
}

/// Looks at a flag until it is as wanted, but not for ever.
fn comes_true(flag: impl Fn() -> bool) -> bool {
    (0..PATIENCE).any(|_| flag())
}

/// The time since start.
pub(crate) struct Clock {
    timeline: Timeline,
    ticker: SYST,
}

impl Clock {
    /// Starts the count, and lets the system timer wake the core.
    pub(crate) fn start(timer: &pac::TIM2, mut ticker: SYST, rates: Rates) -> Self {
        timer.psc().write(|w| w.psc().set(rates::microsecond_prescaler(rates.timer)));
        // The prescaler takes effect with an update, which also sets the count to 0.
        timer.egr().write(|w| w.ug().update());
        timer.cr1().write(|w| w.cen().enabled());
        ticker.set_clock_source(SystClkSource::Core);
        ticker.set_reload(rates.core / board::WAKE_HZ - 1);
        ticker.clear_current();
        ticker.enable_counter();
        ticker.enable_interrupt();
        Self { timeline: Timeline::new(), ticker }
    }

    /// Has the system timer ticked since the last look?
    pub(crate) fn has_ticked(&mut self) -> bool {
        self.ticker.has_wrapped()
    }

    /// What time it is.
    pub(crate) fn now(&mut self) -> Instant {
        self.timeline.extend(micros())
    }
}

/// The count of microseconds as it is; it wraps every 71 minutes.
pub(crate) fn micros() -> u32 {
    // SAFETY: reading the count of a timer changes nothing, whoever owns the timer.
    unsafe { pac::TIM2::steal() }.cnt().read().bits()
}

defmt::timestamp!("{=u32:us}", micros());
