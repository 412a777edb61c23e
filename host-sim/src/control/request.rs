//! The requests of a control socket, and the shape of an answer.

use serde::Deserialize;
use serde_json::{Value, json};

/// A request of a client: a line of a control socket.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(
    tag = "do",
    rename_all = "kebab-case",
    deny_unknown_fields,
    expecting = "a request is an object with a member \"do\""
)]
pub enum ControlRequest {
    /// Adds a fault, for a time or until it is removed.
    Fault {
        /// The fault, as in `--fault`.
        fault: String,
        /// The duration in milliseconds of virtual time; `None`: until it is removed.
        for_ms: Option<u64>,
    },
    /// Removes faults.
    Clear {
        /// The location, such as `3` or `line`. `None`: all faults.
        at: Option<String>,
    },
    /// Lists the faults.
    Faults,
    /// A hand turns a joint, holds it or lets it go.
    Hand {
        /// The joint, 1 to 7.
        joint: u8,
        /// The angle or the action.
        to: HandAction,
    },
    /// Puts a weight into the gripper.
    Weight {
        /// The weight; 0 removes it.
        grams: u16,
    },
    /// Drops everything that the tool holds: the thing between the claws, the weight, and an object of the scene.
    Drop,
    /// Puts a scene on the table round the arm, or removes it.
    Scene {
        /// The scene in its text form, or `off`.
        scene: String,
    },
    /// Forces an alarm on a servo.
    Trip {
        /// The joint, 1 to 7.
        joint: u8,
        /// The alarm; by default an overload.
        #[serde(default)]
        alarm: ForcedAlarm,
    },
    /// Switches the power of the arm.
    Power {
        /// The switch: off, on, or off and on again.
        to: Power,
    },
    /// Restarts the controller. The servos keep their power.
    Restart,
    /// Stops the controller, as if its program hung.
    Halt,
    /// Stops virtual time.
    Pause,
    /// Lets virtual time go on after a pause.
    Resume,
    /// Lets this much virtual time pass as fast as possible. The answer comes at its end.
    Advance {
        /// The time in milliseconds.
        ms: u64,
    },
    /// Sets the speed of virtual time.
    Speed {
        /// The factor or `max`.
        factor: SpeedFactor,
    },
    /// Keeps a copy of the arm and of virtual time.
    Snapshot {
        /// The name of the copy, 1 to 64 characters.
        name: String,
    },
    /// Sets the arm and virtual time back to a copy.
    Restore {
        /// The name of a copy that was kept.
        name: String,
    },
    /// Asks for the state of the arm.
    State,
}

/// An alarm that is forced on a servo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ForcedAlarm {
    /// The servo latches an overload: the joint is free until its torque is switched off and on.
    #[default]
    Overload,
    /// The servo is 5 degrees Celsius hotter than its limit: the joint is free until the servo has cooled down.
    Heat,
}

/// What a hand does with a joint.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "the hand takes an angle in degrees, \"hold\" or \"let-go\"")]
pub enum HandAction {
    /// Turns the joint to this angle in degrees, and holds it there. A joint with torque turns back.
    Degrees(f64),
    /// Holds the joint where it is, or lets it go.
    Grip(HandGrip),
}

/// The speed of virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "the speed is a factor from 0.001 to 1000, or \"max\"")]
pub enum SpeedFactor {
    /// This multiple of the speed of real time.
    Times(f64),
    /// As fast as possible.
    Max(MaxSpeed),
}

/// The word `max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MaxSpeed {
    /// As fast as possible.
    Max,
}

/// Whether a hand holds a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HandGrip {
    /// A hand holds the joint until the joint has torque.
    Hold,
    /// No hand holds the joint. Without torque, a loaded joint falls.
    LetGo,
}

/// What the power switch does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Power {
    /// Off, until it is switched on.
    Off,
    /// On, if it is off.
    On,
    /// Off and on.
    Cycle,
}

/// Why a request was refused: the members of an answer that is an error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControlRefusal {
    /// What is wrong.
    pub error: String,
    /// What to do.
    pub hint: &'static str,
}

impl ControlRefusal {
    /// A refusal with the text of `error`.
    #[must_use]
    pub fn new(error: impl ToString, hint: &'static str) -> Self {
        Self { error: error.to_string(), hint }
    }
}

/// Parses a line of a control socket.
///
/// # Errors
/// The line is not a request.
pub fn parse(line: &[u8]) -> Result<ControlRequest, ControlRefusal> {
    serde_json::from_slice(line).map_err(|error| {
        ControlRefusal::new(
            error,
            "a request is one JSON object in a line, as {\"do\":\"state\"}; docs/simulation.md lists them",
        )
    })
}

/// The line of an answer, with its line feed.
#[must_use]
pub fn line(answer: Result<Value, ControlRefusal>) -> String {
    let value = match answer {
        Ok(result) => json!({ "ok": result }),
        Err(ControlRefusal { error, hint }) => json!({ "error": error, "hint": hint }),
    };
    format!("{value}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_json_objects() {
        for (line, request) in [
            (r#"{"do":"faults"}"#, ControlRequest::Faults),
            (r#"{"do":"clear"}"#, ControlRequest::Clear { at: None }),
            (
                r#"{"do":"hand","joint":2,"to":120}"#,
                ControlRequest::Hand { joint: 2, to: HandAction::Degrees(120.0) },
            ),
            (
                r#"{"do":"hand","joint":2,"to":"let-go"}"#,
                ControlRequest::Hand { joint: 2, to: HandAction::Grip(HandGrip::LetGo) },
            ),
            (r#"{"do":"advance","ms":250}"#, ControlRequest::Advance { ms: 250 }),
            (r#"{"do":"speed","factor":50}"#, ControlRequest::Speed { factor: SpeedFactor::Times(50.0) }),
            (
                r#"{"do":"speed","factor":"max"}"#,
                ControlRequest::Speed { factor: SpeedFactor::Max(MaxSpeed::Max) },
            ),
            (r#"{"do":"restore","name":"a b"}"#, ControlRequest::Restore { name: "a b".to_owned() }),
            (r#"{"do":"power","to":"cycle"}"#, ControlRequest::Power { to: Power::Cycle }),
            (
                r#" {"do":"fault","fault":"3=missing","for_ms":2000} "#,
                ControlRequest::Fault { fault: "3=missing".to_owned(), for_ms: Some(2_000) },
            ),
        ] {
            assert_eq!(parse(line.as_bytes()), Ok(request));
        }
        for wrong in [
            "",
            "{",
            "[]",
            r#"{"do":"stat"}"#,
            r#"{"do":"weight","grams":-1}"#,
            r#"{"do":"weight","gram":1}"#,
            r#"{"do":"snapshot"}"#,
        ] {
            assert!(parse(wrong.as_bytes()).is_err(), "{wrong}");
        }
        assert!(parse(b"\xFF\xFE").is_err());
        for (line, says) in [
            (r#"{"do":"speed","factor":null}"#, "a factor from 0.001 to 1000"),
            (r#"{"do":"hand","joint":2,"to":null}"#, "an angle in degrees"),
        ] {
            let refusal = parse(line.as_bytes()).unwrap_err();
            assert!(refusal.error.contains(says) && !refusal.error.contains("enum"), "{refusal:?}");
        }
    }

    #[test]
    fn an_answer_is_one_line() {
        assert_eq!(line(Ok(json!({}))), "{\"ok\":{}}\n");
        let refused = line(Err(ControlRefusal::new("a\nb", "c")));
        assert_eq!(refused, "{\"error\":\"a\\nb\",\"hint\":\"c\"}\n");
    }
}
