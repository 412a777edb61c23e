//! Which crystal a board has, from a measurement against the internal oscillator.
//!
//! ```text
//!   crystal ──▶ ÷ 31 (RTCPRE) ──▶ ÷ 8 (input capture of TIM11) ──▶ capture of a count at 16 MHz
//! ```
//!
//! A ready crystal may be the wrong one: 12 MHz with the divider for 8 MHz drives the PLL to 504 MHz, above its limit of 432
//! MHz (DS8626, main PLL characteristics). So the firmware measures the crystal before it uses the PLL. The measurement is as
//! exact as the internal oscillator: 1 % at 25 degrees Celsius, 4 % from -10 to 85 (DS8626, HSI oscillator characteristics).

use crate::clock_rates::INTERNAL_HZ;

/// The divider of the crystal, RTCPRE of RCC_CFGR.
pub const DIVIDER: u8 = 31;
/// Periods of the divided crystal in one capture, IC1PSC of TIM11_CCMR1.
const PERIODS_PER_CAPTURE: u32 = 8;
/// Intervals between captures in one measurement.
const CAPTURES: u32 = 16;
/// Cycles of the crystal in one measurement: 0.5 ms at 8 MHz.
const CYCLES: u32 = DIVIDER as u32 * PERIODS_PER_CAPTURE * CAPTURES;
/// The permitted difference between measurement and crystal, in percent.
const TOLERANCE: u32 = 5;

/// Measures the crystal, in kHz. `capture` returns the next captured count of a timer at the internal oscillator's frequency.
/// `None` if `capture` returns `None` (no capture came in time, or one was missed), or if the count stands still.
pub fn measure_khz(mut capture: impl FnMut() -> Option<u16>) -> Option<u32> {
    // Drop the first capture: it may belong to the time before the timer was set up.
    capture()?;
    let first = capture()?;
    let mut last = first;
    for _ in 0..CAPTURES {
        last = capture()?;
    }
    let ticks = u32::from(last.wrapping_sub(first));
    (CYCLES * (INTERNAL_HZ / 1_000)).checked_div(ticks)
}

/// The crystal among `fitted`, in MHz, that was measured as `khz`. `None` if none is within 5 %.
#[must_use]
pub fn identify(khz: u32, fitted: &[u8]) -> Option<u8> {
    let is_near = |mhz: &u8| khz.abs_diff(u32::from(*mhz) * 1_000) <= u32::from(*mhz) * 10 * TOLERANCE;
    fitted.iter().copied().find(is_near)
}

/// True if the PLL can use each of these crystals, in MHz, a measurement tells them apart, and they are in rising order.
#[must_use]
pub const fn are_distinct(fitted: &[u8]) -> bool {
    // Slice patterns, because a constant expression has no iterators. Crystals have 4 to 26 MHz (DS8626, HSE
    // oscillator).
    let mut rest = fitted;
    let mut lowest = 4;
    while let [mhz, behind @ ..] = rest {
        // Each `as` below widens.
        if *mhz < lowest || *mhz > 26 {
            return false;
        }
        // The next crystal must be so far above this one that their tolerances do not overlap.
        let above = *mhz as u32 * (100 + TOLERANCE) / (100 - TOLERANCE) + 1;
        lowest = if above < 27 { above.to_le_bytes()[0] } else { 27 };
        rest = behind;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const FITTED: &[u8] = &[8, 12, 16, 25];

    /// The measured frequency of a crystal, in kHz, if the internal oscillator runs at `factor` times its nominal 16 MHz. The
    /// count starts close to its wrap.
    fn measured(crystal_hz: f64, factor: f64) -> Option<u32> {
        let mut captures = 0_u32;
        measure_khz(|| {
            captures += 1;
            let seconds = f64::from(captures) * 31.0 * 8.0 / crystal_hz;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // As the timer does.
            let count = (seconds * 16e6 * factor) as u64 + 65_000;
            Some(u16::try_from(count % 65_536).unwrap())
        })
    }

    #[test]
    fn each_crystal_is_identified_over_the_whole_range_of_the_internal_oscillator() {
        for &mhz in FITTED {
            for factor in [0.96, 0.99, 1.0, 1.01, 1.045] {
                let khz = measured(f64::from(mhz) * 1e6, factor).unwrap();
                assert_eq!(identify(khz, FITTED), Some(mhz), "{mhz} MHz at {factor}: {khz} kHz");
            }
        }
    }

    #[test]
    fn a_measurement_is_exact_to_a_tenth_of_a_percent() {
        for mhz in 4_u32..=26 {
            let khz = measured(f64::from(mhz) * 1e6, 1.0).unwrap();
            assert!(khz.abs_diff(mhz * 1_000) <= mhz, "{mhz} MHz: {khz} kHz");
        }
    }

    #[test]
    fn no_other_crystal_is_taken_for_a_fitted_one() {
        for mhz in [4.0, 6.0, 9.216, 10.0, 14.318, 18.0, 20.0, 22.118] {
            for factor in [0.99, 1.0, 1.01] {
                let khz = measured(mhz * 1e6, factor).unwrap();
                assert_eq!(identify(khz, FITTED), None, "{mhz} MHz at {factor}: {khz} kHz");
            }
        }
        assert_eq!(identify(12_000, &[8]), None, "12 MHz on a board for 8 MHz only");
        assert_eq!(identify(0, FITTED), None);
        assert_eq!(identify(u32::MAX, FITTED), None);
    }

    #[test]
    fn without_captures_there_is_no_measurement() {
        assert_eq!(measure_khz(|| None), None);
        let mut left = 10;
        let few = || {
            left -= 1;
            (left > 0).then_some(7)
        };
        assert_eq!(measure_khz(few), None, "the captures end");
        assert_eq!(measure_khz(|| Some(7)), None, "the timer stands still");
    }

    #[test]
    fn crystals_that_a_measurement_cannot_tell_apart_are_refused() {
        assert!(are_distinct(FITTED) && are_distinct(&[4, 26]) && are_distinct(&[]));
        assert!(!are_distinct(&[24, 25]) && !are_distinct(&[8, 8]) && !are_distinct(&[12, 8]));
        assert!(!are_distinct(&[3]) && !are_distinct(&[27]) && !are_distinct(&[26, 8]));
    }
}
