//! Whether one joint is driven, and where to: from released to engaged without a jump (D12, D13).
//!
//! ```text
//!             engage when wanted             the servo was measured             it has torque
//!   Released ────────────────────▶ Waiting ────────────────────────▶ Placed ───────────────────▶ Engaged
//!      ▲                              ▲                                │                            │
//!      └──── released ────────────────┴──────────── the servo was lost ┴────────────────────────────┘
//! ```
//!
//! A joint engages where a fresh measurement says it is, never where somebody thinks it is, and its goal
//! stays there until it has torque: a goal that went ahead would be a jump. Knows nothing of the bus, nor of
//! which joint it is.

use crate::calibration::MicroDegrees;
use crate::trajectory::Trajectory;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Engagement {
    /// Not to be driven.
    Released,
    /// To be driven as soon as it is known where the joint is. If the host named a target in the meantime,
    /// with this value of the time register, the joint goes there once it is engaged.
    Waiting { target: Option<(MicroDegrees, u8)> },
    /// To be given torque where it is.
    Placed,
    /// Driven.
    Engaged,
}

/// One joint's drive.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    engagement: Engagement,
    trajectory: Trajectory,
}

impl Drive {
    /// A joint that is not to be driven.
    pub const RELEASED: Self =
        Self { engagement: Engagement::Released, trajectory: Trajectory::holding(MicroDegrees(0)) };

    /// Drives the joint from the next measurement on.
    pub fn wait(&mut self) {
        self.engagement = Engagement::Waiting { target: None };
    }

    /// Stops driving the joint.
    pub fn release(&mut self) {
        *self = Self::RELEASED;
    }

    /// The servo was lost: the joint is driven again from the next measurement on.
    pub fn lose(&mut self) {
        if self.is_engaged() {
            self.wait();
        }
    }

    /// The host wrote a target. A released joint does not care.
    pub fn aim(&mut self, angle: MicroDegrees, time: u8) {
        match &mut self.engagement {
            Engagement::Released => {}
            Engagement::Waiting { target } => *target = Some((angle, time)),
            Engagement::Placed | Engagement::Engaged => self.trajectory.move_to(angle, time),
        }
    }

    /// The joint was measured at `angle`: a waiting joint engages there. Says whether it did, and holds.
    pub fn engage(&mut self, angle: MicroDegrees) -> Option<Engaged> {
        let Engagement::Waiting { target } = self.engagement else { return None };
        self.engagement = Engagement::Placed;
        self.trajectory = Trajectory::holding(angle);
        let Some((target, time)) = target else { return Some(Engaged::Holding) };
        self.trajectory.move_to(target, time);
        Some(Engaged::Moving)
    }

    /// The joint was given torque: from now on it may move.
    pub fn torque_is_on(&mut self) {
        if self.engagement == Engagement::Placed {
            self.engagement = Engagement::Engaged;
        }
    }

    /// The joint's offset changed: the place where it is has another name from now on, and the way to its
    /// `target` begins there.
    pub fn rename_place(&mut self, place: MicroDegrees, target: MicroDegrees, time: u8) {
        if self.is_engaged() {
            self.trajectory = Trajectory::holding(place);
            self.trajectory.move_to(target, time);
        }
    }

    /// One control cycle further at `speed` (the joint's speed register).
    pub fn advance(&mut self, speed: u8) {
        if self.engagement == Engagement::Engaged {
            self.trajectory.advance(speed);
        }
    }

    /// Is the joint driven, or about to be given torque?
    #[must_use]
    pub fn is_engaged(&self) -> bool {
        matches!(self.engagement, Engagement::Placed | Engagement::Engaged)
    }

    /// Is the joint on its way, or about to go?
    #[must_use]
    pub fn is_moving(&self) -> bool {
        match self.engagement {
            Engagement::Released => false,
            Engagement::Waiting { target } => target.is_some(),
            Engagement::Placed | Engagement::Engaged => self.trajectory.is_moving(),
        }
    }

    /// Where an engaged joint is to be now.
    #[must_use]
    pub const fn set_point(&self) -> MicroDegrees {
        self.trajectory.set_point()
    }
}

/// What a joint does after it engaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engaged {
    /// It holds where it was measured.
    Holding,
    /// It moves to the target the host wrote while it was waiting.
    Moving,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(degrees: u8) -> MicroDegrees {
        MicroDegrees::from_degrees(degrees)
    }

    #[test]
    fn d12_a_joint_engages_where_it_is_and_holds() {
        let mut drive = Drive::RELEASED;
        assert_eq!(drive.engage(degrees(40)), None, "it was not asked to");
        drive.wait();
        assert!(!drive.is_engaged());
        assert_eq!(drive.engage(degrees(40)), Some(Engaged::Holding));
        drive.advance(100);
        assert!(drive.is_engaged() && !drive.is_moving());
        assert_eq!(drive.set_point(), degrees(40));
        assert_eq!(drive.engage(degrees(50)), None, "only once");
    }

    #[test]
    fn a_target_written_while_waiting_is_approached_at_speed() {
        let mut drive = Drive::RELEASED;
        drive.aim(degrees(10), 0);
        drive.wait();
        assert!(!drive.is_moving());
        drive.aim(degrees(60), 0);
        assert!(drive.is_moving(), "a host that waits must not be told that it is there");
        assert_eq!(drive.engage(degrees(40)), Some(Engaged::Moving));
        drive.advance(100);
        assert_eq!(drive.set_point(), degrees(40), "not before it has torque");
        drive.torque_is_on();
        drive.advance(100);
        assert_eq!(drive.set_point(), MicroDegrees(41_900_000), "from where it is, not from anywhere else");
    }

    #[test]
    fn a_lost_joint_waits_and_then_holds_where_it_is_found() {
        let mut drive = Drive::RELEASED;
        drive.lose();
        assert_eq!(drive.engage(degrees(1)), None, "a released joint stays released");
        drive.wait();
        drive.engage(degrees(40));
        drive.aim(degrees(80), 0);
        drive.lose();
        assert!(!drive.is_engaged() && !drive.is_moving());
        assert_eq!(drive.engage(degrees(45)), Some(Engaged::Holding), "the old move is forgotten");
    }

    #[test]
    fn a_lost_joint_keeps_a_target_written_while_it_waits() {
        let mut drive = Drive::RELEASED;
        drive.wait();
        drive.aim(degrees(60), 0);
        drive.lose();
        assert_eq!(drive.engage(degrees(40)), Some(Engaged::Moving));
    }

    #[test]
    fn a_new_offset_moves_the_name_and_not_the_joint() {
        let mut drive = Drive::RELEASED;
        drive.rename_place(degrees(1), degrees(1), 0);
        assert_eq!(drive.set_point(), MicroDegrees(0), "a released joint has no place");
        drive.wait();
        drive.engage(degrees(40));
        drive.rename_place(degrees(43), degrees(40), 0);
        assert_eq!(drive.set_point(), degrees(43));
        assert!(drive.is_moving());
    }
}
