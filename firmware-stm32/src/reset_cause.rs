//! Why the chip started: the flags of RCC_CSR, and the cause that the crash handler recorded in RAM that a restart does
//! not clear.

use protocol_core::registers::map::fault;

/// RCC_CSR (RM0090, section 7.3.21): brown-out or power-on reset.
const BROWN_OUT: u32 = 1 << 25;
/// RCC_CSR: power-on reset.
const POWER_ON: u32 = 1 << 27;
/// RCC_CSR: reset by the independent watchdog.
const INDEPENDENT_WATCHDOG: u32 = 1 << 29;
/// RCC_CSR: reset by the window watchdog.
const WINDOW_WATCHDOG: u32 = 1 << 30;

/// Why the crash handler restarted the chip. RAM is unlikely to hold one of these values by chance after power-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u32)]
pub enum ResetCause {
    /// A panic; the log names its file and line.
    Panic = 0x7B07_DEAD,
    /// A hard fault; bus, memory and usage faults escalate to it.
    HardFault = 0x7B07_FA17,
    /// The crystal stopped while it clocked the core.
    ClockFailure = 0x7B07_C10C,
    /// An interrupt or exception without a handler, or peripherals that `main` finds already taken.
    Unexpected = 0x7B07_0DD1,
}

impl ResetCause {
    /// The cause with this value; `None` if there is none.
    #[must_use]
    pub const fn from_record(record: u32) -> Option<Self> {
        const PANIC: u32 = ResetCause::Panic as u32;
        const HARD_FAULT: u32 = ResetCause::HardFault as u32;
        const CLOCK_FAILURE: u32 = ResetCause::ClockFailure as u32;
        const UNEXPECTED: u32 = ResetCause::Unexpected as u32;
        match record {
            PANIC => Some(Self::Panic),
            HARD_FAULT => Some(Self::HardFault),
            CLOCK_FAILURE => Some(Self::ClockFailure),
            UNEXPECTED => Some(Self::Unexpected),
            _ => None,
        }
    }
}

/// Fault bits of register 241, from RCC_CSR and from the recorded cause. A crash counts as a watchdog restart, because
/// the watchdog would have restarted the chip if the crash handler had not. After power-on a record is ignored.
#[must_use]
pub const fn faults(csr: u32, cause: Option<ResetCause>) -> u8 {
    let powered_on = csr & POWER_ON != 0;
    let mut bits = 0;
    if csr & (INDEPENDENT_WATCHDOG | WINDOW_WATCHDOG) != 0 || (cause.is_some() && !powered_on) {
        bits |= fault::WATCHDOG_RESTART;
    }
    if csr & BROWN_OUT != 0 && !powered_on {
        bits |= fault::BROWN_OUT_RESTART;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIN: u32 = 1 << 26;
    const SOFTWARE: u32 = 1 << 28;

    #[test]
    fn power_on_is_not_reported_although_it_sets_the_brown_out_flag() {
        assert_eq!(faults(POWER_ON | BROWN_OUT | PIN, None), 0);
    }

    #[test]
    fn a_brown_out_is_reported() {
        assert_eq!(faults(BROWN_OUT | PIN, None), fault::BROWN_OUT_RESTART);
    }

    #[test]
    fn both_watchdogs_are_reported() {
        assert_eq!(faults(INDEPENDENT_WATCHDOG | PIN, None), fault::WATCHDOG_RESTART);
        assert_eq!(faults(WINDOW_WATCHDOG | PIN, None), fault::WATCHDOG_RESTART);
    }

    #[test]
    fn a_recorded_cause_is_reported_without_any_flag() {
        assert_eq!(faults(0, Some(ResetCause::Panic)), fault::WATCHDOG_RESTART);
        assert_eq!(faults(SOFTWARE | PIN, Some(ResetCause::HardFault)), fault::WATCHDOG_RESTART);
    }

    #[test]
    fn a_reset_by_button_or_debugger_is_not_reported() {
        assert_eq!(faults(PIN, None), 0);
        assert_eq!(faults(SOFTWARE | PIN, None), 0);
    }

    #[test]
    fn a_record_after_power_on_is_ignored() {
        assert_eq!(faults(POWER_ON | BROWN_OUT, Some(ResetCause::Panic)), 0);
    }

    #[test]
    fn only_the_value_of_a_cause_is_a_record() {
        for cause in
            [ResetCause::Panic, ResetCause::HardFault, ResetCause::ClockFailure, ResetCause::Unexpected]
        {
            assert_eq!(ResetCause::from_record(cause as u32), Some(cause));
        }
        assert_eq!(ResetCause::from_record(0), None);
        assert_eq!(ResetCause::from_record(0xFFFF_FFFF), None);
    }
}
