//! When the next event of an arm is.

use embedded_storage::nor_flash::NorFlash;
use protocol_core::time::{Duration, Instant};

use super::SimulatedArm;
use crate::controller::ArmController;
use crate::servo_bus::ServoBus;

/// A deadline that stays in the past is checked again after this time. With simulated servos, wake-ups without bytes on the
/// host line are at multiples of this time, so that many arms wake up together.
const TICK: Duration = Duration::from_millis(1);
/// Events that no client sees cause no wake-up before this time has passed. Without a client these are all events.
const TICK_WITHOUT_CLIENT: Duration = Duration::from_millis(50);

impl<F: NorFlash, B: ServoBus, C: ArmController> SimulatedArm<F, B, C> {
    /// When to call [`SimulatedArm::advance`] next, unless the host sends bytes. For simulated events that no client sees, the
    /// call can be late: the events keep their times.
    #[must_use]
    pub fn deadline(&self, has_client: bool) -> Instant {
        let line = self.line_deadline().unwrap_or(Instant::FAR_FUTURE).max(self.now);
        if B::IS_REAL {
            let later = self.now + TICK;
            return line.min(if self.controller_due > self.now { self.controller_due } else { later });
        }
        let inside = self.bus.deadline().unwrap_or(Instant::FAR_FUTURE).min(self.controller_due);
        let unobserved = self.now + TICK_WITHOUT_CLIENT;
        if has_client {
            let observed = self.controller.host_deadline().max(self.now + TICK);
            line.min(next_tick(observed.min(inside.max(unobserved))))
        } else {
            next_tick(line.min(inside).max(unobserved))
        }
    }

    fn line_deadline(&self) -> Option<Instant> {
        [self.to_arm.deadline(), self.to_host.deadline()].into_iter().flatten().min()
    }

    /// The next event after the last call. A deadline that stays in the past depends on something else, for example on
    /// an idle line, and is checked again after a tick.
    #[must_use]
    pub fn next_event(&self) -> Instant {
        let later = |deadline| if deadline > self.now { deadline } else { self.now + TICK };
        let or_never = |deadline: Option<Instant>| deadline.map_or(Instant::FAR_FUTURE, later);
        let line = or_never(self.to_arm.deadline()).min(or_never(self.to_host.deadline()));
        let inside = later(self.controller_due).min(or_never(self.bus.deadline()));
        line.min(inside).min(or_never(self.faults.deadline()))
    }
}

/// The first multiple of [`TICK`] at or after a time.
fn next_tick(at: Instant) -> Instant {
    let micros = at.as_micros().checked_next_multiple_of(TICK.as_micros());
    micros.map_or(Instant::FAR_FUTURE, Instant::from_micros)
}
