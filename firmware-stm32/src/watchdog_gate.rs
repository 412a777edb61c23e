//! When the watchdog may be fed: after the control cycle and the host link have both run since the last feed. If one of
//! them hangs or starves the other, the watchdog restarts the chip.

/// True for each task that has run since the last feed.
#[derive(Clone, Copy, Debug, Default)]
pub struct WatchdogGate {
    control_cycle: bool,
    host_link: bool,
}

impl WatchdogGate {
    /// A gate that is closed: neither has run yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { control_cycle: false, host_link: false }
    }

    /// Records that the control cycle sent a frame to the servos.
    pub fn control_cycle_ran(&mut self) {
        self.control_cycle = true;
    }

    /// Records that the host link passed bytes to the controller, or had none to pass.
    pub fn host_link_ran(&mut self) {
        self.host_link = true;
    }

    /// Returns true if the watchdog may be fed now. Both have to run again before it returns true again.
    #[must_use]
    pub fn poll_open(&mut self) -> bool {
        let is_open = self.control_cycle && self.host_link;
        if is_open {
            *self = Self::new();
        }
        is_open
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_have_to_run_before_each_feed() {
        let mut gate = WatchdogGate::new();
        assert!(!gate.poll_open());
        gate.control_cycle_ran();
        gate.control_cycle_ran();
        assert!(!gate.poll_open(), "the host link hangs");
        gate.host_link_ran();
        assert!(gate.poll_open());
        assert!(!gate.poll_open(), "neither has run since");
        gate.host_link_ran();
        assert!(!gate.poll_open(), "the control cycle hangs");
    }
}
