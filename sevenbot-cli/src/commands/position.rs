//! `where`: the position of the tip in millimetres, the direction of the tool, and the wrist.

use std::io::{self, Write};

use clap::Args;
use serde::Serialize;
use sevenbot::cartesian::{DirectionText, PointText, TipPose, Vector};
use sevenbot::{Health, Joint, Problem};

use crate::command_error::CommandError;
use crate::measured_pose::{MeasuredPose, PositionDegrees};
use crate::printer::Printable;
use crate::session::Session;

/// Show the position of the tip in millimetres.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  sevenbot where
  sevenbot where --json

Positions are millimetres from the point where the axis of the base meets the
top plate: x to the right, y forward, z up. The tip is the middle of the disc
that joint 6 turns; a suction cup or claw on it is not included. The tool
direction has length 1 and points from the wrist to the tip. The wrist is where
the axes of joints 4, 5 and 6 meet.

An arm with this project's firmware tells its joints to a count of the servos,
about a quarter of a degree, so the tip is known to a millimetre or two. Others
tell whole degrees: some millimetres. The play of the joints and a bent arm are
not included.

Exit status 1 if a servo does not answer, because the position is unknown then.")]
pub(crate) struct WhereArgs {}

pub(crate) fn run(session: &mut Session) -> Result<(), CommandError> {
    let mut arm = session.connect()?;
    let joints = arm.wait_until_settled()?;
    all_known(&arm.health()?)?;
    session.printer.print(&TipPosition::of(&MeasuredPose::read(&mut arm, joints.positions())?))
}

/// Fails if the position of one of joints 1 to 6 is unknown.
fn all_known(health: &Health) -> Result<(), CommandError> {
    let moves_tip = |joint: Joint| joint.number() <= 6;
    let hides = |problem: &Problem| problem.kind.hides_positions() && problem.joint.is_none_or(moves_tip);
    let unknown: Vec<Problem> = health.problems().into_iter().filter(hides).collect();
    if unknown.is_empty() { Ok(()) } else { Err(CommandError::Problems(unknown)) }
}

/// The position of the tip, for printing.
#[derive(Debug, Serialize)]
struct TipPosition {
    tip_mm: [f64; 3],
    tool: [f64; 3],
    wrist_mm: [f64; 3],
    uncertainty_mm: f64,
    positions_degrees: PositionDegrees,
    #[serde(skip)]
    pose: TipPose,
}

impl TipPosition {
    fn of(measured: &MeasuredPose) -> Self {
        let pose = measured.tip_pose();
        Self {
            tip_mm: components(pose.tip, 100.0),
            tool: components(pose.tool, 10_000.0),
            wrist_mm: components(pose.wrist, 100.0),
            uncertainty_mm: (measured.rounding_mm() * 10.0).round() / 10.0,
            positions_degrees: measured.degrees(),
            pose,
        }
    }
}

/// The components of a vector, rounded to 1 / `steps`.
pub(crate) fn components(vector: Vector, steps: f64) -> [f64; 3] {
    // Adding 0 removes the sign of -0.
    [vector.x, vector.y, vector.z].map(|number| (number * steps).round() / steps + 0.0)
}

impl Printable for TipPosition {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        let TipPose { tip, tool, wrist } = self.pose;
        let angles = self.positions_degrees.texts().join(" ");
        writeln!(out, "tip     {} mm, within {:.1} mm", PointText(tip), self.uncertainty_mm)?;
        writeln!(out, "tool    {}", DirectionText(tool))?;
        writeln!(out, "wrist   {} mm", PointText(wrist))?;
        writeln!(out, "joints  {angles} degrees")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_pose_has_a_position() {
        let position = TipPosition::of(&MeasuredPose::whole([90, 90, 65, 90, 90, 90, 80]));
        let mut text = Vec::new();
        position.write_text(&mut text).expect("memory");
        assert_eq!(
            String::from_utf8(text).expect("text"),
            "tip     0 250.3 219.5 mm, within 5.4 mm\ntool    forward (0 1 0)\nwrist   0 227.9 219.5 mm\n\
             joints  90 90 65 90 90 90 80 degrees\n"
        );
        let json = serde_json::to_string(&position).expect("JSON");
        assert_eq!(
            json,
            "{\"tip_mm\":[0.0,250.31,219.5],\"tool\":[0.0,1.0,0.0],\"wrist_mm\":[0.0,227.85,219.5],\
             \"uncertainty_mm\":5.4,\"positions_degrees\":[90,90,65,90,90,90,80]}"
        );
    }
}
