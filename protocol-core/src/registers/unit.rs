//! The units of registers, and their symbols.

/// The unit of a register's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A plain number, a code, or bits.
    None,
    /// Whole degrees of an angle or an offset of a joint.
    Degree,
    /// Hundredths of a degree.
    Centidegree,
    /// Tenths of a degree per second.
    DecidegreePerSecond,
    /// Tenths of a percent of the stall torque.
    PermilleOfStall,
    /// Percent of the stall torque, for the limits of the push ([D27](crate::decisions#d27)).
    PercentOfStall,
    /// Milliseconds, for the period of set-points ([D23](crate::decisions#d23)).
    Millisecond,
    /// Hundredths of a second.
    Centisecond,
    /// 1.9 degrees per second (docs/protocol.md, D10).
    SpeedStep,
    /// Tenths of a second.
    Decisecond,
    /// Reports per second.
    Hertz,
    /// Tenths of a volt.
    Decivolt,
    /// Degrees Celsius, for the hottest servo.
    Celsius,
    /// Tenths of a firmware version: 30 is 3.0.
    VersionTenths,
}

impl Unit {
    /// The symbol of the unit; empty for [`Unit::None`].
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Degree => "°",
            Self::Centidegree => "× 0.01 °",
            Self::DecidegreePerSecond => "× 0.1 °/s",
            Self::PermilleOfStall => "× 0.1 %",
            Self::PercentOfStall => "%",
            Self::Millisecond => "ms",
            Self::Centisecond => "× 10 ms",
            Self::SpeedStep => "× 1.9 °/s",
            Self::Decisecond => "× 100 ms",
            Self::Hertz => "Hz",
            Self::Decivolt => "× 0.1 V",
            Self::Celsius => "°C",
            Self::VersionTenths => "× 0.1",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_their_usual_symbols() {
        let symbols = [Unit::None, Unit::SpeedStep, Unit::Decisecond, Unit::Hertz].map(Unit::symbol);
        assert_eq!(symbols, ["", "× 1.9 °/s", "× 100 ms", "Hz"]);
        let symbols = [Unit::Decivolt, Unit::Celsius, Unit::VersionTenths].map(Unit::symbol);
        assert_eq!(symbols, ["× 0.1 V", "°C", "× 0.1"]);
        let symbols = [Unit::Centidegree, Unit::DecidegreePerSecond, Unit::PermilleOfStall].map(Unit::symbol);
        assert_eq!(symbols, ["× 0.01 °", "× 0.1 °/s", "× 0.1 %"]);
        assert_eq!([Unit::Millisecond, Unit::Centisecond].map(Unit::symbol), ["ms", "× 10 ms"]);
    }
}
