//! Clock frequencies and the dividers that follow from them.

use protocol_core::registers::map::fault;

/// The source of the core clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ClockSource {
    /// The crystal, through the PLL: the normal case.
    Crystal,
    /// The internal oscillator, through the PLL: no crystal can be used.
    InternalPll,
    /// The internal oscillator: the PLL failed.
    Internal,
    /// The emulator, which has no clock tree.
    Emulated,
}

/// Clock frequencies of the chip, in Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockRates {
    /// The core and its system timer.
    pub core: u32,
    /// The slower peripheral bus: USART2.
    pub apb1: u32,
    /// The faster peripheral bus: USART1.
    pub apb2: u32,
    /// The timers of the slower bus: TIM2. Twice the bus clock if that is divided (RM0090, figure 21).
    pub timer: u32,
}

/// Frequency of the internal oscillator, in Hz.
pub const INTERNAL_HZ: u32 = 16_000_000;

impl ClockSource {
    /// Its fault bits in register 241.
    #[must_use]
    pub const fn faults(self) -> u8 {
        match self {
            Self::Crystal | Self::Emulated => 0,
            Self::InternalPll | Self::Internal => fault::CRYSTAL_FAILED,
        }
    }

    /// The frequencies with this source: the core runs at 168 MHz, with [`Self::Internal`] at 16 MHz.
    #[must_use]
    pub const fn rates(self) -> ClockRates {
        const FULL: ClockRates =
            ClockRates { core: 168_000_000, apb1: 42_000_000, apb2: 84_000_000, timer: 84_000_000 };
        match self {
            Self::Crystal | Self::InternalPll => FULL,
            Self::Internal => {
                ClockRates { core: INTERNAL_HZ, apb1: INTERNAL_HZ, apb2: INTERNAL_HZ, timer: INTERNAL_HZ }
            }
            // QEMU clocks all timers of this chip at 1 GHz.
            Self::Emulated => ClockRates { timer: 1_000_000_000, ..FULL },
        }
    }
}

/// Value of the USART register BRR for oversampling by 16 (RM0090, section 30.3.4): the divisor of the bus clock in
/// sixteenths, rounded to the nearest. At least 16, as the USART requires.
#[must_use]
pub const fn usart_divisor(bus_hz: u32, baud: u32) -> u16 {
    let divisor = match (bus_hz + baud / 2).checked_div(baud) {
        Some(divisor) => divisor,
        None => u32::MAX,
    };
    let [_, _, high, low] = divisor.to_be_bytes();
    match divisor {
        0..16 => 16,
        16..=0xFFFF => u16::from_be_bytes([high, low]),
        _ => u16::MAX,
    }
}

/// Value of the timer register PSC for a count of microseconds: the divisor less one.
#[must_use]
pub const fn microsecond_prescaler(timer_hz: u32) -> u16 {
    let [_, _, high, low] = (timer_hz / 1_000_000).saturating_sub(1).to_be_bytes();
    u16::from_be_bytes([high, low])
}

/// The argument of `cortex_m::asm::delay` for a delay of at least `micros`. The argument counts steps of a loop, and
/// each takes three cycles of the core (cortex-m 0.7.10; subtraction and taken branch of a Cortex-M4).
#[must_use]
pub const fn delay_steps(core_hz: u32, micros: u32) -> u32 {
    const CYCLES_PER_STEP: u32 = 3;
    (core_hz / 1_000_000).saturating_mul(micros).div_ceil(CYCLES_PER_STEP)
}

#[cfg(test)]
mod tests {
    use protocol_core::registers::map::BAUD_RATES;

    use super::*;

    #[test]
    fn the_error_of_every_baud_rate_is_below_half_a_percent() {
        for source in [ClockSource::Crystal, ClockSource::InternalPll, ClockSource::Internal] {
            for bus in [source.rates().apb1, source.rates().apb2] {
                for baud in BAUD_RATES {
                    let real = f64::from(bus) / f64::from(usart_divisor(bus, baud));
                    let error = (real / f64::from(baud) - 1.0).abs();
                    assert!(error < 0.005, "{source:?} {bus} {baud}: {error}");
                }
            }
        }
    }

    #[test]
    fn one_megabaud_is_exact_on_every_clock() {
        for source in [ClockSource::Crystal, ClockSource::InternalPll, ClockSource::Internal] {
            let bus = source.rates().apb1;
            assert_eq!(u32::from(usart_divisor(bus, 1_000_000)) * 1_000_000, bus);
        }
    }

    #[test]
    fn every_divisor_fits_the_register() {
        assert_eq!(usart_divisor(16_000_000, 4_000_000), 16);
        assert_eq!(usart_divisor(84_000_000, 300), u16::MAX);
        assert_eq!(usart_divisor(84_000_000, 0), u16::MAX);
    }

    #[test]
    fn a_delay_of_2_ms_takes_2_ms_on_every_clock() {
        let steps = [ClockSource::Crystal, ClockSource::InternalPll, ClockSource::Internal]
            .map(|source| delay_steps(source.rates().core, 2_000));
        assert_eq!(steps, [112_000, 112_000, 10_667], "336,000 and 32,000 cycles");
        assert_eq!(delay_steps(u32::MAX, u32::MAX), u32::MAX.div_ceil(3));
    }

    #[test]
    fn the_timer_counts_microseconds_on_every_clock() {
        for (source, prescaler) in
            [(ClockSource::Crystal, 83), (ClockSource::Internal, 15), (ClockSource::Emulated, 999)]
        {
            assert_eq!(microsecond_prescaler(source.rates().timer), prescaler);
        }
    }
}
