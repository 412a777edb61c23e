//! The independent watchdog (IWDG). `firmware_stm32::watchdog_gate` decides when the loop may feed it.

use firmware_stm32::wait::wait_for;
use firmware_stm32::watchdog_gate::WatchdogGate;
use stm32f4::stm32f405 as pac;

use crate::board;

/// Polls until the registers have taken their values. They take 5 cycles of the watchdog's oscillator: 50,000 core
/// cycles at 17 kHz.
const UPDATE_POLLS: u32 = 20_000;

/// The running watchdog.
pub(crate) struct Watchdog(pac::IWDG);

impl Watchdog {
    /// Starts the watchdog. Only a reset stops it.
    pub(crate) fn start(registers: pac::IWDG, dbgmcu: &pac::DBGMCU) -> Self {
        // The watchdog stands still while a debugger halts the core.
        dbgmcu.apb1_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        // The oscillator has to run before the registers take a value (RM0090, section 21.3).
        registers.kr().write(|w| w.key().start());
        registers.kr().write(|w| w.key().unlock());
        registers.pr().write(|w| w.pr().divide_by64());
        registers.rlr().write(|w| w.rl().set(board::WATCHDOG_TURNS));
        // Both values cross into the oscillator's clock domain and take effect with the next feed. Without that feed
        // the first period would use the old reload value.
        let _ = wait_for(UPDATE_POLLS, || {
            let status = registers.sr().read();
            !status.pvu().bit() && !status.rvu().bit()
        });
        let watchdog = Self(registers);
        watchdog.feed();
        watchdog
    }

    /// Feeds the watchdog unconditionally. For start-up, for erases and for the self-test image.
    pub(crate) fn feed(&self) {
        self.0.kr().write(|w| w.key().feed());
    }

    /// Feeds the watchdog if `gate` is open.
    pub(crate) fn feed_through(&self, gate: &mut WatchdogGate) {
        if gate.poll_open() {
            self.feed();
        }
    }
}
