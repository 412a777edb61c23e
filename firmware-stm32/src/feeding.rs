//! When the watchdog may be fed: after both the control cycle and the host link have run since the last
//! time. One of them hanging, or starving the other, ends in a restart.

/// Who has run since the watchdog was fed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Feeding {
    control_cycle: bool,
    host_link: bool,
}

impl Feeding {
    /// Nobody has run yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { control_cycle: false, host_link: false }
    }

    /// The control cycle has spoken to the servos.
    pub fn control_cycle_ran(&mut self) {
        self.control_cycle = true;
    }

    /// The host link has handed over what it had.
    pub fn host_link_ran(&mut self) {
        self.host_link = true;
    }

    /// Is it time to feed? If so, both have to run again before the next time.
    #[must_use]
    pub fn is_due(&mut self) -> bool {
        let due = self.control_cycle && self.host_link;
        if due {
            *self = Self::new();
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_have_to_run_each_time() {
        let mut feeding = Feeding::new();
        assert!(!feeding.is_due());
        feeding.control_cycle_ran();
        feeding.control_cycle_ran();
        assert!(!feeding.is_due(), "the link hangs");
        feeding.host_link_ran();
        assert!(feeding.is_due());
        assert!(!feeding.is_due(), "nobody has run since");
        feeding.host_link_ran();
        assert!(!feeding.is_due(), "the control cycle hangs");
    }
}
