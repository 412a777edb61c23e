//! The solution of an exercise: converts the steps in its file to programs of blocks.

use serde::Deserialize;
use serde_json::{Value, json};

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum SolutionStep {
    /// Moves a joint: its number, 1 to 7, the angle in degrees, the speed in degrees per second.
    Joint(u8, f64, f64),
    /// Moves the tip, with the tool down: x, y, z in mm, the speed of the joints in degrees per second.
    Tip(f64, f64, f64, f64),
    /// Moves the tip along a straight line, with the tool down: x, y, z in mm, the speed of the tip in mm per second.
    Line(f64, f64, f64, f64),
    /// Opens the claws, or closes them.
    Grip(Claws),
    /// Waits for this time, in seconds.
    Wait(f64),
    /// Removes the obstacles of the simulated arm, so that its joints can move again.
    Repair,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Claws {
    Open,
    Close,
}

/// A part of a solution. The parts solve the exercise one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SolutionPart {
    /// A program of blocks: the JSON of a Blockly workspace.
    Program(String),
    /// Removes the obstacles of the simulated arm.
    Repair,
}

/// Converts steps to programs. Each [`SolutionStep::Repair`] ends the program before it.
pub(crate) fn parts(steps: &[SolutionStep]) -> Vec<SolutionPart> {
    let groups = steps.chunk_by(|one, other| {
        !matches!(one, SolutionStep::Repair) && !matches!(other, SolutionStep::Repair)
    });
    groups
        .map(|group| match group {
            [SolutionStep::Repair] => SolutionPart::Repair,
            steps => SolutionPart::Program(workspace(steps)),
        })
        .collect()
}

/// The JSON of a workspace whose program has these steps. In this JSON each block contains the block below it.
fn workspace(steps: &[SolutionStep]) -> String {
    let stack = steps.iter().enumerate().rev().fold(None, |next, (number, step)| {
        let mut block = block(step)?;
        add(&mut block, "id", json!(format!("step-{number}")));
        if let Some(next) = next {
            add(&mut block, "next", json!({ "block": next }));
        }
        Some(block)
    });
    let mut start = json!({"type": "arm_start", "id": "start", "deletable": false, "x": 20, "y": 20});
    if let Some(first) = stack {
        add(&mut start, "next", json!({ "block": first }));
    }
    json!({"blocks": {"languageVersion": 0, "blocks": [start]}}).to_string()
}

fn block(step: &SolutionStep) -> Option<Value> {
    let with = |kind: &str, fields: Value, inputs: &[(&str, f64)]| {
        let inputs: serde_json::Map<_, _> =
            inputs.iter().map(|(name, value)| ((*name).to_owned(), number(*value))).collect();
        Some(json!({"type": kind, "fields": fields, "inputs": inputs}))
    };
    let down = || json!({"TOOL": "DOWN"});
    match *step {
        SolutionStep::Joint(joint, degrees, speed) => {
            let fields = json!({"JOINT": joint.to_string()});
            with("arm_move_joint", fields, &[("ANGLE", degrees), ("SPEED", speed)])
        }
        SolutionStep::Tip(x, y, z, speed) => {
            with("arm_move_tip", down(), &[("X", x), ("Y", y), ("Z", z), ("SPEED", speed)])
        }
        SolutionStep::Line(x, y, z, speed) => {
            with("arm_line", down(), &[("X", x), ("Y", y), ("Z", z), ("SPEED", speed)])
        }
        SolutionStep::Grip(claws) => {
            let state = if matches!(claws, Claws::Open) { "OPEN" } else { "CLOSE" };
            with("arm_grip", json!({"STATE": state}), &[])
        }
        SolutionStep::Wait(seconds) => with("arm_wait", json!({}), &[("SECONDS", seconds)]),
        SolutionStep::Repair => None,
    }
}

/// A number in the input of a block, as a shadow block: the user can put another block in its place.
fn number(value: f64) -> Value {
    json!({"shadow": {"type": "math_number", "fields": {"NUM": value}}})
}

fn add(block: &mut Value, name: &str, value: Value) {
    if let Value::Object(members) = block {
        members.insert(name.to_owned(), value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_become_programs_between_repairs() {
        let steps = [
            SolutionStep::Joint(1, 120.0, 60.0),
            SolutionStep::Wait(1.0),
            SolutionStep::Repair,
            SolutionStep::Tip(0.0, 200.0, 60.0, 30.0),
        ];
        let parts = parts(&steps);
        let [SolutionPart::Program(first), SolutionPart::Repair, SolutionPart::Program(last)] =
            parts.as_slice()
        else {
            panic!("{parts:?}")
        };
        let first: Value = serde_json::from_str(first).expect("JSON");
        let joint = &first["blocks"]["blocks"][0]["next"]["block"];
        assert_eq!((&joint["type"], &joint["fields"]["JOINT"]), (&json!("arm_move_joint"), &json!("1")));
        assert_eq!(joint["next"]["block"]["inputs"]["SECONDS"]["shadow"]["fields"]["NUM"], json!(1.0));
        assert!(last.contains("arm_move_tip") && !last.contains("arm_wait"));
    }
}
