//! Counts of the receive errors of a USART. An overrun is a byte that was not read in time. Framing errors and noise come
//! from bad edges or from a wrong baud rate.

use crate::usart_status::{FRAMING, NOISE, OVERRUN};

/// Number of errors of each kind since start. The counts saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct LineErrors {
    /// How often bytes were lost, because one was not read before the next one was complete.
    pub overruns: u16,
    /// How often the stop bit was missing.
    pub framing: u16,
    /// How often the samples of a bit differed.
    pub noise: u16,
}

impl LineErrors {
    /// No errors yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { overruns: 0, framing: 0, noise: 0 }
    }

    /// Counts the errors in a value of USART_SR. Call it once for each read of USART_DR, which clears the bits.
    #[cold]
    pub const fn count(&mut self, status: u16) {
        self.overruns = self.overruns.saturating_add((status & OVERRUN != 0) as u16);
        self.framing = self.framing.saturating_add((status & FRAMING != 0) as u16);
        self.noise = self.noise.saturating_add((status & NOISE != 0) as u16);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::usart_status::{PARITY, RECEIVED};

    #[test]
    fn each_error_has_its_own_count() {
        let mut errors = LineErrors::new();
        errors.count(RECEIVED | PARITY);
        assert_eq!(errors, LineErrors::new());
        errors.count(RECEIVED | OVERRUN);
        errors.count(RECEIVED | FRAMING | NOISE);
        errors.count(FRAMING);
        assert_eq!(errors, LineErrors { overruns: 1, framing: 2, noise: 1 });
    }

    #[test]
    fn a_count_saturates() {
        let mut errors = LineErrors { overruns: u16::MAX, ..LineErrors::new() };
        errors.count(OVERRUN);
        assert_eq!(errors.overruns, u16::MAX);
    }
}
