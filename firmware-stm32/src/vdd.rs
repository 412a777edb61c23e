//! The supply voltage of the chip, computed from a reading of the internal voltage reference.

/// The supply of the chip when it was calibrated, in millivolts (DS8626, internal reference voltage calibration).
const CALIBRATED_AT_MILLIVOLTS: u32 = 3_300;
/// 3.3 V +/- 5 %.
const GOOD_MILLIVOLTS: core::ops::RangeInclusive<u32> = 3_135..=3_465;

/// The supply in millivolts, from the factory's reading of the internal reference and from the present one. `None` if the
/// factory's reading is not in 1 to 4095, or if the present one is 0.
#[must_use]
pub fn millivolts(calibration: u16, reading: u16) -> Option<u32> {
    let is_calibrated = (1..4_096).contains(&calibration);
    let volts = (CALIBRATED_AT_MILLIVOLTS * u32::from(calibration)).checked_div(u32::from(reading));
    volts.filter(|_| is_calibrated)
}

/// True if this supply is within 5 % of 3.3 V.
#[must_use]
pub fn is_good(millivolts: u32) -> bool {
    GOOD_MILLIVOLTS.contains(&millivolts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_higher_reading_of_the_reference_means_a_lower_supply() {
        // 1.21 V of 3.3 V are 1502 of 4095.
        assert_eq!(millivolts(1_502, 1_502), Some(3_300));
        assert_eq!(millivolts(1_502, 1_652), Some(3_000));
        assert!(is_good(3_300) && is_good(3_135) && !is_good(3_000) && !is_good(3_500));
    }

    #[test]
    fn a_reading_out_of_range_gives_no_supply() {
        assert_eq!(millivolts(1_502, 0), None);
        assert_eq!(millivolts(0, 1_502), None);
        assert_eq!(millivolts(0xFFFF, 1_502), None, "erased calibration value");
    }
}
