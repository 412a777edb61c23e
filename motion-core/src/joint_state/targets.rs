//! Moves the set-point of one joint towards the targets of the host, as far as an obstacle allows
//! ([D10](protocol_core::decisions#d10), [D23](protocol_core::decisions#d23), [D24](protocol_core::decisions#d24),
//! [D27](protocol_core::decisions#d27)).

use protocol_core::registers::RegisterFile;
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::time::{Duration, Instant};

use super::JointState;
use crate::calibration::MicroDegrees;

impl JointState {
    /// Advances the set-point by the control cycle that ends at `end`, as far as an obstacle allows
    /// ([D27](protocol_core::decisions#d27)).
    pub(crate) fn advance(&mut self, end: Instant, speed: u8, registers: &mut RegisterFile) {
        self.drive.advance(end, speed);
        let Some(angle) = self.measured else { return };
        let (set_point, target) = (self.drive.set_point(), self.drive.target());
        if let Some(held) = self.obstacle.hold_back(end, set_point, target, angle) {
            self.drive.hold_back(held.set_point);
            if held.ends_move {
                self.hold(registers);
            }
        }
    }

    /// Moves the set-point at once to where the joint is, as far as that is on the way to the target.
    pub(crate) fn catch_up(&mut self) {
        if let Some(angle) = self.measured {
            self.drive.catch_up(angle);
        }
    }

    /// Starts a move to a coarse target. The register shows it already.
    pub(crate) fn move_to(&mut self, degrees: u8, time: u8) {
        self.target = MicroDegrees::from_degrees(degrees);
        self.obstacle.target_written();
        self.drive.set_target(self.target, time);
    }

    /// Adds the next point of a stream, whose frame came at `now`. A joint that is let go takes none
    /// ([D28](protocol_core::decisions#d28)).
    pub(crate) fn stream_to(
        &mut self,
        now: Instant,
        angle: MicroDegrees,
        period: Duration,
        registers: &mut RegisterFile,
    ) {
        if !self.let_go.is_let_go() {
            self.set_target(angle, registers);
            self.obstacle.point_written(now);
            self.drive.stream_to(angle, now, period);
        }
    }

    /// Starts a move to a target, and shows it in the coarse register.
    pub(crate) fn approach(&mut self, angle: MicroDegrees, time: u8, registers: &mut RegisterFile) {
        self.set_target(angle, registers);
        self.obstacle.target_written();
        self.drive.set_target(angle, time);
    }

    /// Sets the target and shows it in the coarse register, without a move.
    pub(crate) fn set_target(&mut self, target: MicroDegrees, registers: &mut RegisterFile) {
        self.target = target;
        registers.set(TARGET_POSITION.of(self.joint), target.nearest_degree());
    }

    /// Holds at the set-point, which becomes the target. The register of a joint without a set-point stays, but the joint will
    /// hold where it engages.
    pub(crate) fn hold(&mut self, registers: &mut RegisterFile) {
        self.drive.hold();
        if self.drive.has_set_point() {
            self.set_target(self.drive.set_point(), registers);
        }
    }
}
