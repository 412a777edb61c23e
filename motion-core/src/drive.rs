//! The drive of one joint: from released to engaged without a jump ([D12](protocol_core::decisions#d12),
//! [D13](protocol_core::decisions#d13)).
//!
//! ```text
//!                 wait                       measured, steady            torque is on
//!   Released ───────────────────────▶ Waiting ───────────────▶ TorquePending ─────────▶ Engaged
//!      ▲                                                          ▲     │                  │
//!      │                                          measured, steady│     │ no answers       │
//!      │                                                          │     ▼                  │
//!      └── released, from every state ──                        Silent ◀─────────────────┘
//! ```
//!
//! A waiting joint engages at its measured position or, after a restart of the controller alone, at a near goal that its
//! servo still holds. Its goal stays there until it has torque, so that the servo does not jump. A silent joint keeps its
//! set-point, because its servo may still hold there. A joint that loses its torque waits again. So does one whose servo stops
//! answering while its torque is pending, unless it was silent before. This file does not know the bus or which joint it
//! drives.

use protocol_core::time::{Duration, Instant};

use crate::calibration::MicroDegrees;
use crate::trajectory::Trajectory;

/// A silent joint that is measured within this distance of its set-point continues its move
/// ([D12](protocol_core::decisions#d12)).
const REJOIN_WITHIN: MicroDegrees = MicroDegrees::from_degrees(3);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Engagement {
    /// The joint is not driven.
    Released,
    /// The joint will engage once it is measured at rest. If the host writes a target meanwhile (`has_target`), the trajectory
    /// keeps it.
    Waiting { has_target: bool },
    /// The goal of the joint is the angle at which it engages, or its set-point if it continues after a silence. The servo has
    /// no torque yet, unless it kept its torque during a silence or a restart of the controller.
    TorquePending { was_silent: bool, has_new_target: bool },
    /// The joint has torque and follows its set-point.
    Engaged,
    /// The servo of a driven joint does not answer. The set-point does not move.
    Silent { has_new_target: bool },
}

/// The target of a joint that engaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// The angle at which it engaged: the joint holds there.
    Measured,
    /// The target that the host wrote, or the target that the joint had before a silence.
    FromHost,
}

/// Whether one joint is released, engaging, engaged or silent, and the trajectory of its set-point.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Drive {
    engagement: Engagement,
    trajectory: Trajectory,
}

impl Drive {
    /// A joint that is not driven.
    pub const RELEASED: Self =
        Self { engagement: Engagement::Released, trajectory: Trajectory::holding(MicroDegrees(0)) };

    /// Lets the joint engage once it is measured at rest.
    pub fn wait(&mut self) {
        self.engagement = Engagement::Waiting { has_target: false };
    }

    /// Stops driving the joint, from every state, and forgets its set-point and its target.
    pub fn release(&mut self) {
        *self = Self::RELEASED;
    }

    /// Marks the servo as silent. An engaged joint keeps its set-point until the servo answers again. A joint whose
    /// torque is pending is silent again if it was silent before; otherwise it waits again.
    pub fn mark_silent(&mut self) {
        self.engagement = match self.engagement {
            Engagement::Engaged => Engagement::Silent { has_new_target: false },
            Engagement::TorquePending { was_silent: true, has_new_target } => {
                Engagement::Silent { has_new_target }
            }
            Engagement::TorquePending { has_new_target, .. } => {
                Engagement::Waiting { has_target: has_new_target || self.trajectory.is_moving() }
            }
            other => other,
        };
    }

    /// Sets the target that the host wrote. A released joint ignores it.
    pub fn set_target(&mut self, angle: MicroDegrees, time: u8) {
        if let Some(trajectory) = self.take_target() {
            trajectory.move_to(angle, time);
        }
    }

    /// Adds the next point of a stream, whose frame came at `now`. A released joint ignores it.
    pub fn stream_to(&mut self, angle: MicroDegrees, now: Instant, period: Duration) {
        if let Some(trajectory) = self.take_target() {
            trajectory.stream_to(angle, now, period);
        }
    }

    /// The trajectory for a new target of the host; `None` for a released joint.
    fn take_target(&mut self) -> Option<&mut Trajectory> {
        match &mut self.engagement {
            Engagement::Released => return None,
            Engagement::Waiting { has_target: is_new }
            | Engagement::Silent { has_new_target: is_new }
            | Engagement::TorquePending { has_new_target: is_new, .. } => *is_new = true,
            Engagement::Engaged => {}
        }
        Some(&mut self.trajectory)
    }

    /// Lets the joint hold at its set-point, and forgets a target that the host wrote before.
    pub fn hold(&mut self) {
        if let Engagement::Waiting { has_target: is_new }
        | Engagement::Silent { has_new_target: is_new }
        | Engagement::TorquePending { has_new_target: is_new, .. } = &mut self.engagement
        {
            *is_new = false;
        }
        self.trajectory = Trajectory::holding(self.set_point());
    }

    /// Engages a joint that is at rest at `angle`. A waiting joint engages there. A silent joint continues from its
    /// set-point if that is near, and engages at `angle` otherwise. Returns which target the joint has; `None` if it does not
    /// engage.
    pub fn engage(&mut self, angle: MicroDegrees) -> Option<Target> {
        let (Engagement::Waiting { has_target } | Engagement::Silent { has_new_target: has_target }) =
            self.engagement
        else {
            return None;
        };
        let was_silent = self.is_silent();
        let continues = was_silent && is_near(self.set_point(), angle);
        let target = if continues || has_target { Target::FromHost } else { Target::Measured };
        if target == Target::Measured {
            self.trajectory = Trajectory::holding(angle);
        } else if !continues {
            self.trajectory.rebase(angle);
        }
        self.engagement = Engagement::TorquePending { was_silent, has_new_target: has_target };
        Some(target)
    }

    /// The servo has no torque any more: the joint engages anew where it is measured. Unless `keeps_target`, an earlier
    /// target of the host is forgotten; a silent joint always keeps a target that came during the silence.
    pub fn lose_torque(&mut self, keeps_target: bool) {
        self.engagement = match self.engagement {
            Engagement::Engaged => {
                Engagement::Waiting { has_target: keeps_target && self.trajectory.is_moving() }
            }
            // The joint may be at a new target already, and move away from it before it has torque.
            Engagement::TorquePending { has_new_target, .. } => Engagement::Waiting {
                has_target: keeps_target && (has_new_target || self.trajectory.is_moving()),
            },
            Engagement::Silent { has_new_target } => Engagement::Waiting { has_target: has_new_target },
            other => other,
        };
    }

    /// Is the joint engaged, so that its set-point may move?
    #[must_use]
    pub fn is_engaged(&self) -> bool {
        self.engagement == Engagement::Engaged
    }

    /// Does the joint wait to be measured?
    pub(crate) fn is_waiting(&self) -> bool {
        matches!(self.engagement, Engagement::Waiting { .. })
    }

    /// Has the servo of a driven joint fallen silent?
    #[must_use]
    pub fn is_silent(&self) -> bool {
        matches!(self.engagement, Engagement::Silent { .. })
    }

    /// Records that a joint whose torque was pending has torque. From now on its set-point may move.
    pub fn torque_is_on(&mut self) {
        if self.is_torque_pending() {
            self.engagement = Engagement::Engaged;
        }
    }

    /// Replaces the set-point after a change of the joint's offset. `set_point` and `target` use the new offset.
    pub fn rebase_offset(&mut self, set_point: MicroDegrees, target: MicroDegrees, time: u8) {
        if self.has_set_point() {
            self.trajectory = Trajectory::holding(set_point);
            self.trajectory.move_to(target, time);
        }
    }

    /// Advances the set-point by the control cycle that ends at `end`, at `speed` (the joint's speed register).
    pub fn advance(&mut self, end: Instant, speed: u8) {
        if self.engagement == Engagement::Engaged {
            self.trajectory.advance(end, speed);
        }
    }

    /// Takes back the part of the last step beyond `set_point`: see [`Trajectory::hold_back`].
    pub fn hold_back(&mut self, set_point: MicroDegrees) {
        self.trajectory.hold_back(set_point);
    }

    /// Moves the set-point towards its target at once, as far as `angle`: see [`Trajectory::catch_up`].
    pub fn catch_up(&mut self, angle: MicroDegrees) {
        self.trajectory.catch_up(angle);
    }

    /// Does the joint have a set-point? A silent joint does, because its servo may still hold there.
    #[must_use]
    pub fn has_set_point(&self) -> bool {
        self.is_driven() || self.is_silent()
    }

    /// Is the joint engaged, or is its torque pending? Only such a joint is sent goals.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        matches!(self.engagement, Engagement::TorquePending { .. } | Engagement::Engaged)
    }

    /// Is the joint waiting for its torque?
    #[must_use]
    pub fn is_torque_pending(&self) -> bool {
        matches!(self.engagement, Engagement::TorquePending { .. })
    }

    /// Is the set-point still on its way to the target, or does a target wait until the joint engages?
    #[must_use]
    pub fn is_moving(&self) -> bool {
        match self.engagement {
            Engagement::Released => false,
            Engagement::Waiting { has_target } => has_target,
            Engagement::TorquePending { .. } | Engagement::Engaged | Engagement::Silent { .. } => {
                self.trajectory.is_moving()
            }
        }
    }

    /// The target of the trajectory; in a stream its newest point.
    #[must_use]
    pub const fn target(&self) -> MicroDegrees {
        self.trajectory.target()
    }

    /// The present set-point of a joint that has one.
    #[must_use]
    pub const fn set_point(&self) -> MicroDegrees {
        self.trajectory.set_point()
    }
}

/// Is `angle` within 3 degrees of the set-point, so that a joint measured there continues its move
/// ([D12](protocol_core::decisions#d12))?
pub(crate) fn is_near(set_point: MicroDegrees, angle: MicroDegrees) -> bool {
    angle.0.abs_diff(set_point.0) <= REJOIN_WITHIN.0.unsigned_abs()
}

#[cfg(test)]
mod tests;
