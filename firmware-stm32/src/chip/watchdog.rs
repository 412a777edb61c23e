//! The independent watchdog (IWDG). `crate::watchdog_gate` decides when the loop may feed it.

use stm32f4::stm32f405 as pac;

use super::{board, clock};
use crate::wait::wait_within;
use crate::watchdog_gate::WatchdogGate;

/// The longest wait until the registers have taken their values, in microseconds. ST's drivers wait as long: six cycles
/// of 32 kHz behind a divider of 256. Behind the divider of 64 here, five cycles of the slowest oscillator take 19 ms.
const UPDATE_MICROS: u32 = 48_000;

/// The running watchdog.
pub struct Watchdog(pac::IWDG);

impl Watchdog {
    /// Starts the watchdog. Only a reset stops it. TIM2 has to run already.
    pub fn start(registers: pac::IWDG, dbgmcu: &pac::DBGMCU) -> Self {
        // While a probe halts the core, torque and pump stay on. So the watchdog keeps counting and restarts the chip, except
        // in an image for a debugger. The bit outlives a reset, so it is written in both cases.
        dbgmcu.apb1_fz().modify(|_, w| w.dbg_iwdg_stop().bit(cfg!(feature = "halt-watchdog")));
        // The oscillator has to run before the registers take a value (RM0090, section 21.3).
        registers.kr().write(|w| w.key().start());
        registers.kr().write(|w| w.key().unlock());
        registers.pr().write(|w| w.pr().divide_by64());
        registers.rlr().write(|w| w.rl().set(board::WATCHDOG_TURNS));
        // Both values cross into the oscillator's clock domain and take effect with the next feed. Without that feed
        // the first period would use the old reload value.
        let _ = wait_within(UPDATE_MICROS, clock::micros, || {
            let status = registers.sr().read();
            !status.pvu().bit() && !status.rvu().bit()
        });
        let watchdog = Self(registers);
        watchdog.feed();
        watchdog
    }

    /// Feeds the watchdog unconditionally. For start-up, for erases and for the self-test image.
    pub fn feed(&self) {
        self.0.kr().write(|w| w.key().feed());
    }

    /// Feeds the watchdog if `gate` is open.
    pub fn feed_through(&self, gate: &mut WatchdogGate) {
        if gate.poll_open() {
            self.feed();
        }
    }
}
