//! Actions of a person or a test on a running arm, and their text form: `fault 3=missing`, `hand 2 445`, `power-cycle`.

use alloc::vec::Vec;
use core::fmt::{self, Display, Formatter};
use core::str::FromStr;

use protocol_core::registers::Joint;
use protocol_core::time::Duration;

use crate::faults::{ArmFault, FaultLocation};
use crate::scene::Scene;
use crate::servo::Trip;

/// Something that is done to an arm. In the text form, the duration of a fault is in microseconds, and the position of a hand in
/// counts of the servo.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Action {
    /// `disconnect`: the last client closes the port.
    Disconnect,
    /// `power-off`, until [`Action::PowerCycle`].
    PowerOff,
    /// `power-cycle`: off and on.
    PowerCycle,
    /// `restart`: the controller restarts, and the servos keep their power.
    RestartController,
    /// `halt`: the controller hangs.
    HaltController,
    /// `fault 3=missing` or, for two seconds, `fault 3=missing 2000000`.
    Fault(ArmFault, Option<Duration>),
    /// `clear` removes all faults, `clear 3` the faults of one location.
    Clear(Option<FaultLocation>),
    /// `hand 2 445`: a hand turns a joint to a position and holds it there.
    Hand(Joint, u16),
    /// `hold 2`: a hand holds a joint where it is, until the joint has torque.
    Hold(Joint),
    /// `let-go 2`: the hand lets a joint go.
    LetGo(Joint),
    /// `weight 150`: grams in the gripper.
    Weight(u16),
    /// `drop`: the tool drops everything. The weight disappears, and so does a thing between the claws. An object of the scene
    /// falls.
    Drop,
    /// `trip 2` latches an overload of a joint's servo that has torque; `trip 2 heat` makes the servo too hot.
    Trip(Joint, Trip),
    /// `scene cube red 30 40 0 220; table -60`: what stands on the table ([`Scene`]). `scene off` removes the table, too.
    Scene(Option<Scene>),
    /// `seed 7`: the seed of the random faults of the host line.
    Seed(u64),
}

/// The text is not an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "use disconnect, power-off, power-cycle, restart, halt, fault, clear, hand, hold, let-go, weight, \
     drop, trip, scene or seed, with their values"
)]
pub struct UnknownAction;

impl FromStr for Action {
    type Err = UnknownAction;

    fn from_str(text: &str) -> Result<Self, UnknownAction> {
        fn value<T: FromStr>(word: &str) -> Result<T, UnknownAction> {
            word.parse().map_err(|_| UnknownAction)
        }
        let joint = |word: &str| value(word).and_then(|number| Joint::new(number).ok_or(UnknownAction));
        if let Some(scene) = text.strip_prefix("scene ") {
            let scene = if scene == "off" { None } else { Some(value(scene)?) };
            return Ok(Self::Scene(scene));
        }
        let words: Vec<&str> = text.split(' ').collect();
        Ok(match *words.as_slice() {
            ["disconnect"] => Self::Disconnect,
            ["power-off"] => Self::PowerOff,
            ["power-cycle"] => Self::PowerCycle,
            ["restart"] => Self::RestartController,
            ["halt"] => Self::HaltController,
            ["fault", fault] => Self::Fault(value(fault)?, None),
            ["fault", fault, micros] => {
                Self::Fault(value(fault)?, Some(Duration::from_micros(value(micros)?)))
            }
            ["clear"] => Self::Clear(None),
            ["clear", location] => Self::Clear(Some(value(location)?)),
            ["hand", number, counts] => Self::Hand(joint(number)?, value(counts)?),
            ["hold", number] => Self::Hold(joint(number)?),
            ["let-go", number] => Self::LetGo(joint(number)?),
            ["weight", grams] => Self::Weight(value(grams)?),
            ["drop"] => Self::Drop,
            ["trip", number] => Self::Trip(joint(number)?, Trip::Overload),
            ["trip", number, "heat"] => Self::Trip(joint(number)?, Trip::Heat),
            ["seed", seed] => Self::Seed(value(seed)?),
            _ => return Err(UnknownAction),
        })
    }
}

impl Display for Action {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Disconnect => out.write_str("disconnect"),
            Self::PowerOff => out.write_str("power-off"),
            Self::PowerCycle => out.write_str("power-cycle"),
            Self::RestartController => out.write_str("restart"),
            Self::HaltController => out.write_str("halt"),
            Self::Fault(fault, None) => write!(out, "fault {fault}"),
            Self::Fault(fault, Some(duration)) => write!(out, "fault {fault} {}", duration.as_micros()),
            Self::Clear(None) => out.write_str("clear"),
            Self::Clear(Some(location)) => write!(out, "clear {location}"),
            Self::Hand(joint, counts) => write!(out, "hand {} {counts}", joint.number()),
            Self::Hold(joint) => write!(out, "hold {}", joint.number()),
            Self::LetGo(joint) => write!(out, "let-go {}", joint.number()),
            Self::Weight(grams) => write!(out, "weight {grams}"),
            Self::Drop => out.write_str("drop"),
            Self::Trip(joint, Trip::Overload) => write!(out, "trip {}", joint.number()),
            Self::Trip(joint, Trip::Heat) => write!(out, "trip {} heat", joint.number()),
            Self::Scene(None) => out.write_str("scene off"),
            Self::Scene(Some(scene)) => write!(out, "scene {scene}"),
            Self::Seed(seed) => write!(out, "seed {seed}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn the_words_of_an_action_are_parsed_back() {
        for text in [
            "disconnect",
            "power-off",
            "power-cycle",
            "restart",
            "halt",
            "fault 3=garbled=10",
            "fault line=loss=2.5% 2000000",
            "fault bus=echo",
            "clear",
            "clear 3",
            "clear supply",
            "hand 2 445",
            "hold 7",
            "let-go 1",
            "weight 150",
            "drop",
            "trip 2",
            "trip 2 heat",
            "fault 2=wall=60.5/500 2000000",
            "scene off",
            "scene table -60; cube red 30 40 0 220 0",
            "seed 18446744073709551615",
        ] {
            assert_eq!(text.parse::<Action>().map(|action| action.to_string()), Ok(text.into()));
        }
        for text in [
            "",
            "trip",
            "trip 8",
            "trip 2 cold",
            "hand 2",
            "hand 0 1",
            "hand 8 1",
            "fault",
            "fault 3",
            "clear x",
            "weight -1",
            "scene",
            "scene cube",
            "seed",
            "on",
        ] {
            assert_eq!(text.parse::<Action>(), Err(UnknownAction), "{text}");
        }
    }
}
