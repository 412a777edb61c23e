//! The influences on a joint from outside its servo: the arm's weight, inertia and contacts, a hand that pushes, and obstacles.
//!
//! Positions are in millionths of a count. Torques are in micronewton metres, positive towards more counts. There are no
//! angles here.

use super::units::COUNT;

/// Where an obstacle is, seen from the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Side {
    /// It stops a joint that turns towards more counts.
    MoreCounts,
    /// It stops a joint that turns towards fewer counts.
    FewerCounts,
}

/// An obstacle in the way of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Surface {
    pub(crate) side: Side,
    /// Where the joint touches it.
    pub(crate) position: i64,
    /// Its torque for each count that the joint presses into it. `None`: it does not give way.
    pub(crate) stiffness: Option<i64>,
}

impl Surface {
    /// How far a joint at this position presses into the surface. Negative: the joint does not touch it.
    const fn depth(&self, position: i64) -> i64 {
        match self.side {
            Side::MoreCounts => position - self.position,
            Side::FewerCounts => self.position - position,
        }
    }

    /// The torque of a soft obstacle on a joint at this position.
    fn torque(&self, position: i64) -> i64 {
        let size = self.stiffness.unwrap_or(0) * self.depth(position).max(0) / COUNT;
        match self.side {
            Side::MoreCounts => -size,
            Side::FewerCounts => size,
        }
    }

    /// Limits a range of positions to those that a joint at `from` can reach.
    fn bound(&self, from: i64, (low, high): (i64, i64)) -> (i64, i64) {
        match (self.stiffness, self.side) {
            (Some(_), _) => (low, high),
            // A joint that is already behind the surface cannot go deeper.
            (None, Side::MoreCounts) => (low, high.min(self.position.max(from))),
            (None, Side::FewerCounts) => (low.max(self.position.min(from)), high),
        }
    }

    /// Does a joint at this position touch it?
    pub(crate) const fn is_touched(&self, position: i64) -> bool {
        self.depth(position) >= 0
    }
}

/// The influences on a joint from outside its servo. Torques are in micronewton metres, positive towards more counts.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Surroundings {
    /// The torque of the arm's weight.
    pub(crate) weight: i64,
    /// The inertia of the arm about the joint, without its servo, in gram square millimetres.
    pub(crate) inertia: i64,
    /// The torque of a hand.
    pub(crate) push: i64,
    /// The torque of the arm's contacts in its room.
    pub(crate) contact: i64,
    pub(crate) wall: Option<Surface>,
    /// The thing between the claws. Only joint 7 has it.
    pub(crate) thing: Option<Surface>,
}

impl Surroundings {
    /// Is there a wall, a thing between the claws, or a hand that pushes?
    pub(crate) const fn has_contact(&self) -> bool {
        self.wall.is_some() || self.thing.is_some() || self.push != 0
    }

    fn obstacles(&self) -> impl Iterator<Item = &Surface> {
        [&self.wall, &self.thing].into_iter().flatten()
    }

    /// The torque on a joint at this position. Stiff obstacles have none: they limit [`Surroundings::range`] instead.
    pub(crate) fn torque(&self, position: i64) -> i64 {
        let obstacles: i64 = self.obstacles().map(|obstacle| obstacle.torque(position)).sum();
        self.weight + self.push + self.contact + obstacles
    }

    /// Limits a range of positions to those that a joint at `from` can reach.
    pub(crate) fn range(&self, from: i64, range: (i64, i64)) -> (i64, i64) {
        self.obstacles().fold(range, |range, obstacle| obstacle.bound(from, range))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: (i64, i64) = (0, 1_000);

    fn wall(side: Side, stiffness: Option<i64>) -> Surroundings {
        let wall = Some(Surface { side, position: 500, stiffness });
        Surroundings { wall, ..Surroundings::default() }
    }

    #[test]
    fn a_stiff_wall_bounds_a_joint_on_one_side() {
        let above = wall(Side::MoreCounts, None);
        assert_eq!([above.range(400, ALL), above.range(600, ALL)], [(0, 500), (0, 600)]);
        let below = wall(Side::FewerCounts, None);
        assert_eq!([below.range(600, ALL), below.range(400, ALL)], [(500, 1_000), (400, 1_000)]);
        assert_eq!([above.torque(600), below.torque(400)], [0; 2]);
    }

    #[test]
    fn a_soft_wall_pushes_back_by_its_depth() {
        for (side, sign) in [(Side::MoreCounts, 1), (Side::FewerCounts, -1)] {
            let soft = wall(side, Some(3 * COUNT));
            assert_eq!(soft.range(400, ALL), ALL);
            assert_eq!([500 - 10 * sign, 500, 500 + 10 * sign].map(|at| soft.torque(at)), [0, 0, -30 * sign]);
        }
    }

    #[test]
    fn weight_hand_and_thing_add_up() {
        let thing = Some(Surface { side: Side::FewerCounts, position: 100, stiffness: Some(COUNT) });
        let all = Surroundings { weight: 5, push: -7, thing, ..wall(Side::MoreCounts, Some(COUNT)) };
        assert_eq!(all.torque(90), 5 - 7 + 10);
        assert_eq!(all.torque(510), 5 - 7 - 10);
    }
}
