//! The text form of the obstacles of a joint: `2=wall=60`, `2=wall=60/500`, `2=push=-300`, `7=thing=30`.

use alloc::borrow::ToOwned;
use alloc::string::String;
use core::fmt::{self, Display, Formatter};
use core::str::FromStr;

use protocol_core::registers::Joint;

use crate::fault_count::FaultCount;
use crate::plant::{HIGHEST_STIFFNESS, Plant, STRONGEST_PUSH, Thing, Wall};
use crate::thousandths::Thousandths;

/// Something that a joint meets. Its count is the number of milliseconds in which the joint touched it or was pushed by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Obstacle {
    /// A wall: in front of the joint or behind it, depending on where the joint is when the wall is set.
    Wall(Wall),
    /// A hand that pushes with this torque, in millinewton metres. Positive values are towards greater angles.
    Push(i16),
    /// A thing between the claws. Only joint 7 can meet it.
    Thing(Thing),
}

/// The word is not an obstacle.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{0}' is no obstacle: use wall=DEGREES, wall=DEGREES/STIFFNESS with 1 to 5000 mN m per degree, \
     push=MILLINEWTON_METRES with -10000 to 10000, or, of joint 7, thing=DEGREES or thing=DEGREES/STIFFNESS; \
     degrees are 0 to 180, with at most three decimals"
)]
pub struct UnknownObstacle(String);

impl Obstacle {
    /// Does a word name a kind of obstacle?
    pub(super) fn is_kind(word: &str) -> bool {
        matches!(word.split('=').next(), Some("wall" | "push" | "thing"))
    }

    /// Can this joint meet the obstacle?
    pub(super) const fn is_possible_at(self, joint: Joint) -> bool {
        !matches!(self, Self::Thing(_)) || joint.number() == 7
    }

    /// Puts the obstacle in the way of a joint.
    pub(super) fn apply(self, joint: Joint, plant: &mut Plant) {
        match self {
            Self::Wall(wall) => plant.set_wall(joint, Some(wall)),
            Self::Push(torque) => plant.push(joint, torque),
            Self::Thing(thing) => plant.set_thing(Some(thing)),
        }
    }

    /// Removes the obstacle from a joint.
    pub(super) fn remove(self, joint: Joint, plant: &mut Plant) {
        match self {
            Self::Wall(_) => plant.set_wall(joint, None),
            Self::Push(_) => plant.push(joint, 0),
            Self::Thing(_) => plant.set_thing(None),
        }
    }

    /// Milliseconds in which the joint touched the obstacle, or was pushed by it.
    pub(crate) fn count(self, joint: Joint, plant: &Plant) -> FaultCount {
        match self {
            Self::Wall(_) => plant.wall_count(joint),
            Self::Push(_) => plant.push_count(joint),
            Self::Thing(_) => plant.thing_count(),
        }
    }
}

impl FromStr for Obstacle {
    type Err = UnknownObstacle;

    fn from_str(word: &str) -> Result<Self, UnknownObstacle> {
        let obstacle =
            match word.split_once('=') {
                Some(("wall", place)) => surface(place)
                    .map(|(millidegrees, stiffness)| Self::Wall(Wall { millidegrees, stiffness })),
                Some(("thing", place)) => surface(place)
                    .map(|(millidegrees, stiffness)| Self::Thing(Thing { millidegrees, stiffness })),
                Some(("push", torque)) => {
                    let is_possible = |torque: &i16| (-STRONGEST_PUSH..=STRONGEST_PUSH).contains(torque);
                    torque.parse().ok().filter(is_possible).map(Self::Push)
                }
                _ => None,
            };
        obstacle.ok_or_else(|| UnknownObstacle(word.to_owned()))
    }
}

/// Parses degrees, and the stiffness if it follows.
fn surface(text: &str) -> Option<(i32, Option<u16>)> {
    let (degrees, stiffness) = match text.split_once('/') {
        None => (text, None),
        Some((degrees, stiffness)) => (degrees, Some(stiffness.parse().ok()?)),
    };
    let is_possible = stiffness.is_none_or(|stiffness| (1..=HIGHEST_STIFFNESS).contains(&stiffness));
    Some((millidegrees(degrees)?, stiffness)).filter(|_| is_possible)
}

/// Parses degrees with at most three decimals, 0 to 180.
fn millidegrees(text: &str) -> Option<i32> {
    let Thousandths(millidegrees) = Thousandths::parse(text)?;
    (0..=180_000).contains(&millidegrees).then_some(millidegrees)
}

impl Display for Obstacle {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        let (name, millidegrees, stiffness) = match self {
            Self::Push(torque) => return write!(out, "push={torque}"),
            Self::Wall(Wall { millidegrees, stiffness }) => ("wall", millidegrees, stiffness),
            Self::Thing(Thing { millidegrees, stiffness }) => ("thing", millidegrees, stiffness),
        };
        write!(out, "{name}={}", Thousandths(*millidegrees))?;
        stiffness.map_or(Ok(()), |stiffness| write!(out, "/{stiffness}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_obstacle_is_printed_as_it_is_read() {
        for word in ["wall=60", "wall=60.5/500", "wall=0.007", "wall=180/5000", "push=-300", "thing=30.25/1"]
        {
            assert_eq!(word.parse::<Obstacle>().unwrap().to_string(), word);
        }
        let wall = Wall { millidegrees: 60_500, stiffness: Some(500) };
        assert_eq!("wall=60.5/500".parse(), Ok(Obstacle::Wall(wall)));
    }

    #[test]
    fn other_words_are_refused_with_the_possible_ones() {
        for word in [
            "wall",
            "wall=",
            "wall=181",
            "wall=-1",
            "wall=60.1234",
            "wall=60/",
            "wall=60/0",
            "wall=60/5001",
            "wall=60/x",
            "push=",
            "push=10001",
            "push=-10001",
            "push=1.5",
            "thing=x",
            "fence=3",
            "wall=6e1",
        ] {
            let error = word.parse::<Obstacle>().unwrap_err().to_string();
            assert!(error.contains(word) && error.contains("use wall="), "{error}");
        }
    }
}
