//! Why the arm started: what the chip says (RCC_CSR) and what the last run left in memory that a restart
//! does not clear.

use protocol_core::registers::map::fault;

/// RCC_CSR (RM0090, section 7.3.21): the supply was below the brown-out level, or has just come on.
const BROWN_OUT: u32 = 1 << 25;
/// The supply has just come on.
const POWER_ON: u32 = 1 << 27;
/// The independent watchdog bit.
const INDEPENDENT_WATCHDOG: u32 = 1 << 29;
/// The window watchdog bit.
const WINDOW_WATCHDOG: u32 = 1 << 30;

/// What ended a run. The numbers are unlikely to stand in memory by chance when the supply comes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u32)]
pub enum Ending {
    /// A panic.
    Panic = 0x7B07_DEAD,
    /// A hard fault.
    HardFault = 0x7B07_FA17,
    /// The crystal stopped.
    ClockFailure = 0x7B07_C10C,
    /// An interrupt or exception that nobody expects.
    Unexpected = 0x7B07_0DD1,
}

impl Ending {
    /// What `record` says; `None` if it is no record.
    #[must_use]
    pub const fn from_record(record: u32) -> Option<Self> {
        const PANIC: u32 = Ending::Panic as u32;
        const HARD_FAULT: u32 = Ending::HardFault as u32;
        const CLOCK_FAILURE: u32 = Ending::ClockFailure as u32;
        const UNEXPECTED: u32 = Ending::Unexpected as u32;
        match record {
            PANIC => Some(Self::Panic),
            HARD_FAULT => Some(Self::HardFault),
            CLOCK_FAILURE => Some(Self::ClockFailure),
            UNEXPECTED => Some(Self::Unexpected),
            _ => None,
        }
    }
}

/// Fault bits for the status block, from RCC_CSR and from what the last run recorded. A run that ended in
/// a fault counts as one that the watchdog ended: it would have been, had it not restarted by itself.
#[must_use]
pub const fn faults(csr: u32, ending: Option<Ending>) -> u8 {
    let powered_on = csr & POWER_ON != 0;
    let mut bits = 0;
    if csr & (INDEPENDENT_WATCHDOG | WINDOW_WATCHDOG) != 0 || (ending.is_some() && !powered_on) {
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
    fn power_on_is_no_fault_though_it_sets_the_brown_out_flag() {
        assert_eq!(faults(POWER_ON | BROWN_OUT | PIN, None), 0);
    }

    #[test]
    fn a_supply_that_sagged_is_told() {
        assert_eq!(faults(BROWN_OUT | PIN, None), fault::BROWN_OUT_RESTART);
    }

    #[test]
    fn both_watchdogs_are_told() {
        assert_eq!(faults(INDEPENDENT_WATCHDOG | PIN, None), fault::WATCHDOG_RESTART);
        assert_eq!(faults(WINDOW_WATCHDOG | PIN, None), fault::WATCHDOG_RESTART);
    }

    #[test]
    fn a_recorded_ending_is_told_where_the_chip_tells_nothing() {
        assert_eq!(faults(0, Some(Ending::Panic)), fault::WATCHDOG_RESTART);
        assert_eq!(faults(SOFTWARE | PIN, Some(Ending::HardFault)), fault::WATCHDOG_RESTART);
    }

    #[test]
    fn a_reset_button_or_a_debugger_is_no_fault() {
        assert_eq!(faults(PIN, None), 0);
        assert_eq!(faults(SOFTWARE | PIN, None), 0);
    }

    #[test]
    fn a_record_after_power_on_is_chance() {
        assert_eq!(faults(POWER_ON | BROWN_OUT, Some(Ending::Panic)), 0);
    }

    #[test]
    fn only_endings_are_records() {
        for ending in [Ending::Panic, Ending::HardFault, Ending::ClockFailure, Ending::Unexpected] {
            assert_eq!(Ending::from_record(ending as u32), Some(ending));
        }
        assert_eq!(Ending::from_record(0), None);
        assert_eq!(Ending::from_record(0xFFFF_FFFF), None);
    }
}
