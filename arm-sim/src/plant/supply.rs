//! The supply of the servos: its voltage under load, and its faults.

use core::fmt::{self, Display, Formatter};
use core::str::FromStr;

use protocol_core::time::{Duration, Instant};

use crate::fault_count::FaultCount;
use crate::servo::units::STEP;

/// The supply voltage without load, in 0.1 V: the nominal voltage of the servos.
const NOMINAL_DECIVOLTS: u16 = 74;
/// The voltage drop for each servo with full load, in 0.1 V. Assumed.
const DROP_DECIVOLTS: u16 = 3;
/// The voltage during a dip, in 0.1 V: low enough to restart each servo. Assumed, like the duration.
const DIP_DECIVOLTS: u16 = 30;
const DIP: Duration = Duration::from_millis(20);

/// A fault of the supply of the servos. The controller has its own supply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SupplyFault {
    /// The voltage without load, in 0.1 V.
    Volts(u8),
    /// After each period of this length the voltage falls to 3 V for 20 ms, and all servos restart.
    Dips(Duration),
    /// No voltage: no servo answers.
    Off,
}

/// The word is not a fault of the supply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("use supply=volts=VOLTS with 0.0 to 7.4, supply=dips=MILLISECONDS with 100 or more, or supply=off")]
pub struct UnknownSupplyFault;

impl FromStr for SupplyFault {
    type Err = UnknownSupplyFault;

    fn from_str(word: &str) -> Result<Self, UnknownSupplyFault> {
        let fault = match word.split_once('=') {
            None if word == "off" => Some(Self::Off),
            Some(("volts", volts)) => decivolts(volts).map(Self::Volts),
            Some(("dips", millis)) => {
                let millis = millis.parse().ok().filter(|&millis| millis >= 100);
                millis.map(|millis| Self::Dips(Duration::from_millis(millis)))
            }
            _ => None,
        };
        fault.ok_or(UnknownSupplyFault)
    }
}

/// Parses volts with at most one decimal, up to the nominal voltage.
fn decivolts(text: &str) -> Option<u8> {
    let (whole, tenths) = text.split_once('.').unwrap_or((text, "0"));
    let digits = |text: &str| text.len() == 1 && text.bytes().all(|digit| digit.is_ascii_digit());
    let (true, true) = (digits(whole), digits(tenths)) else { return None };
    let decivolts = whole.parse::<u8>().ok()? * 10 + tenths.parse::<u8>().ok()?;
    (u16::from(decivolts) <= NOMINAL_DECIVOLTS).then_some(decivolts)
}

impl Display for SupplyFault {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Volts(decivolts) => write!(out, "volts={}.{}", decivolts / 10, decivolts % 10),
            Self::Dips(period) => write!(out, "dips={}", period.as_micros() / 1_000),
            Self::Off => out.write_str("off"),
        }
    }
}

/// The voltage source of all servos, with its power switch and its fault.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Supply {
    fault: Option<SupplyFault>,
    /// When the fault began.
    since: Instant,
    is_switched_off: bool,
    is_in_dip: bool,
    count: FaultCount,
}

impl Supply {
    /// Sets or removes the fault, and resets its count. The first period begins at `now`. The power switch keeps its position.
    pub(super) fn set_fault(&mut self, now: Instant, fault: Option<SupplyFault>) {
        let is_switched_off = self.is_switched_off;
        *self = Self { fault, since: now, is_switched_off, ..Self::default() };
    }

    /// Switches the supply on or off, with or without a fault.
    pub(super) const fn switch(&mut self, is_on: bool) {
        self.is_switched_off = !is_on;
    }

    /// The voltage in 0.1 V. `load` is the sum of the loads of all servos, each in 0.1 % of its full load.
    pub(super) fn decivolts(&self, now: Instant, load: u16) -> u8 {
        let without_load = match self.fault {
            _ if self.is_switched_off => 0,
            Some(SupplyFault::Off) => 0,
            Some(SupplyFault::Volts(decivolts)) => u16::from(decivolts),
            Some(SupplyFault::Dips(period)) if self.is_dip(now, period) => DIP_DECIVOLTS,
            _ => NOMINAL_DECIVOLTS,
        };
        let drop = u32::from(load) * u32::from(DROP_DECIVOLTS) / 1_000;
        u8::try_from(u32::from(without_load).saturating_sub(drop)).unwrap_or(0)
    }

    fn is_dip(&self, now: Instant, period: Duration) -> bool {
        let elapsed = (now - self.since).as_micros();
        elapsed >= period.as_micros() && elapsed.checked_rem(period.as_micros()) < Some(DIP.as_micros())
    }

    /// Counts the dips. Call it in each step; steps up to [`Supply::steady_until`] can be left out.
    pub(super) fn step(&mut self, now: Instant) {
        if let Some(SupplyFault::Dips(period)) = self.fault {
            let is_in_dip = self.is_dip(now, period);
            if is_in_dip && !self.is_in_dip {
                self.count.count(true);
            }
            self.is_in_dip = is_in_dip;
        }
    }

    /// The time until which the voltage without load does not change.
    pub(super) fn steady_until(&self, now: Instant) -> Instant {
        let Some(SupplyFault::Dips(period)) = self.fault else { return Instant::FAR_FUTURE };
        if self.is_in_dip || self.is_dip(now, period) {
            return now;
        }
        let period = period.as_micros().max(1);
        let dips = (now - self.since).as_micros() / period;
        let next = self.since + Duration::from_micros((dips + 1).saturating_mul(period));
        Instant::from_micros(next.as_micros().saturating_sub(STEP.as_micros()))
    }

    /// Counts a valid frame on the bus, during [`SupplyFault::Volts`] or [`SupplyFault::Off`].
    pub(super) const fn count_frame(&mut self) {
        if matches!(self.fault, Some(SupplyFault::Volts(_) | SupplyFault::Off)) {
            self.count.count(true);
        }
    }

    /// How often the fault took effect: in dips for [`SupplyFault::Dips`], otherwise in frames.
    pub(super) const fn count(&self) -> FaultCount {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    #[test]
    fn each_fault_has_a_name() {
        for (word, fault) in [
            ("off", SupplyFault::Off),
            ("volts=5.5", SupplyFault::Volts(55)),
            ("dips=500", SupplyFault::Dips(Duration::from_millis(500))),
        ] {
            assert_eq!(word.parse(), Ok(fault));
            assert_eq!(fault.to_string(), word);
        }
        assert_eq!("volts=6".parse(), Ok(SupplyFault::Volts(60)));
        for wrong in ["", "on", "volts=7.5", "volts=-1", "volts=5.55", "volts=55", "dips=99", "dips"] {
            assert_eq!(wrong.parse::<SupplyFault>(), Err(UnknownSupplyFault), "{wrong}");
        }
    }

    #[test]
    fn load_lowers_the_voltage() {
        let mut supply = Supply::default();
        assert_eq!(supply.decivolts(at(0), 0), 74);
        assert_eq!(supply.decivolts(at(0), 2_000), 68);
        supply.set_fault(at(0), Some(SupplyFault::Volts(55)));
        assert_eq!(supply.decivolts(at(0), 1_000), 52);
        supply.switch(false);
        assert_eq!(supply.decivolts(at(0), 0), 0);
    }

    #[test]
    fn a_dip_comes_after_each_period_and_lasts_20_ms() {
        let mut supply = Supply::default();
        supply.set_fault(at(1_000), Some(SupplyFault::Dips(Duration::from_millis(500))));
        let low: Vec<u64> = (1_000..2_100)
            .filter(|&millis| {
                supply.step(at(millis));
                supply.decivolts(at(millis), 0) == 30
            })
            .collect();
        let expected: Vec<u64> = (1_500..1_520).chain(2_000..2_020).collect();
        assert_eq!(low, expected);
        assert_eq!(supply.count(), FaultCount { effects: 2, occasions: 2 });
        assert_eq!(supply.steady_until(at(2_100)), at(2_499));
        assert_eq!(supply.steady_until(at(2_510)), at(2_510));
    }
}
