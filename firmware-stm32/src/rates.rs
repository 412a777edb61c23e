//! Clock frequencies, and what has to be divided by how much.

use protocol_core::registers::map::fault;

/// Where the core clock comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Source {
    /// The crystal, through the PLL: as it should be.
    Crystal,
    /// The internal oscillator, through the PLL: the crystal is dead.
    InternalPll,
    /// The internal oscillator: the PLL is dead.
    Internal,
    /// No clock tree at all: this is the emulator.
    Emulated,
}

/// How fast the parts of the chip run, in Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rates {
    /// The core and its system timer.
    pub core: u32,
    /// The slower peripheral bus: USART2.
    pub apb1: u32,
    /// The faster peripheral bus: USART1.
    pub apb2: u32,
    /// The timers of the slower bus: TIM2. Twice the bus where that is divided (RM0090, figure 21).
    pub timer: u32,
}

/// The internal oscillator.
pub const INTERNAL_HZ: u32 = 16_000_000;

impl Source {
    /// What the status block says of it.
    #[must_use]
    pub const fn faults(self) -> u8 {
        match self {
            Self::Crystal | Self::Emulated => 0,
            Self::InternalPll | Self::Internal => fault::CRYSTAL_FAILED,
        }
    }

    /// The frequencies that go with it.
    #[must_use]
    pub const fn rates(self) -> Rates {
        const FULL: Rates =
            Rates { core: 168_000_000, apb1: 42_000_000, apb2: 84_000_000, timer: 84_000_000 };
        match self {
            Self::Crystal | Self::InternalPll => FULL,
            Self::Internal => {
                Rates { core: INTERNAL_HZ, apb1: INTERNAL_HZ, apb2: INTERNAL_HZ, timer: INTERNAL_HZ }
            }
            // QEMU clocks every timer of the chip with 1 GHz.
            Self::Emulated => Rates { timer: 1_000_000_000, ..FULL },
        }
    }
}

/// What a USART of 16-fold oversampling divides its bus clock by (RM0090, section 30.3.4): a whole number
/// of sixteenths, which is just what its register BRR holds. Nearest value, never less than the 16 it needs.
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

/// What a timer divides its clock by to count microseconds: the value of its register PSC, one less than
/// the divisor.
#[must_use]
pub const fn microsecond_prescaler(timer_hz: u32) -> u16 {
    let [_, _, high, low] = (timer_hz / 1_000_000).saturating_sub(1).to_be_bytes();
    u16::from_be_bytes([high, low])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rates of register 12.
    const BAUDS: [u32; 8] = [115_200, 250_000, 500_000, 1_000_000, 57_600, 38_400, 19_200, 9_600];

    #[test]
    fn every_baud_rate_is_met_within_half_a_percent() {
        for source in [Source::Crystal, Source::InternalPll, Source::Internal] {
            for bus in [source.rates().apb1, source.rates().apb2] {
                for baud in BAUDS {
                    let real = f64::from(bus) / f64::from(usart_divisor(bus, baud));
                    let error = (real / f64::from(baud) - 1.0).abs();
                    assert!(error < 0.005, "{source:?} {bus} {baud}: {error}");
                }
            }
        }
    }

    #[test]
    fn one_megabaud_is_exact_on_every_clock() {
        for source in [Source::Crystal, Source::InternalPll, Source::Internal] {
            let bus = source.rates().apb1;
            assert_eq!(u32::from(usart_divisor(bus, 1_000_000)) * 1_000_000, bus);
        }
    }

    #[test]
    fn no_divisor_is_out_of_what_the_register_holds() {
        assert_eq!(usart_divisor(16_000_000, 4_000_000), 16);
        assert_eq!(usart_divisor(84_000_000, 300), u16::MAX);
        assert_eq!(usart_divisor(84_000_000, 0), u16::MAX);
    }

    #[test]
    fn the_timer_counts_microseconds_on_every_clock() {
        for (source, prescaler) in [(Source::Crystal, 83), (Source::Internal, 15), (Source::Emulated, 999)] {
            assert_eq!(microsecond_prescaler(source.rates().timer), prescaler);
        }
    }
}
