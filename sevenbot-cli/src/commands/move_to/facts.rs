//! The output of `move-to`.

use std::io::{self, Write};

use serde::Serialize;
use sevenbot::Angle;
use sevenbot::cartesian::{DirectionText, PointText, TipPose, TipTarget, Vector};

use super::super::position::components;
use crate::printer::Printable;

/// A move to a point: the plan, and with --wait the measured result.
#[derive(Debug, Serialize)]
pub(super) struct TipMove {
    asked_mm: [f64; 3],
    /// The direction of the tool.
    tool: [f64; 3],
    /// Joints 1 to 5.
    targets_degrees: [u8; 5],
    planned_mm: [f64; 3],
    planned_miss_mm: f64,
    planned_tilt_degrees: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<MeasuredTip>,
    #[serde(skip)]
    direction: Vector,
}

/// The arm at the end of a move.
#[derive(Debug, Serialize)]
pub(super) struct MeasuredTip {
    positions_degrees: [u8; 7],
    tip_mm: [f64; 3],
    miss_mm: f64,
}

impl TipMove {
    /// A planned move.
    pub(super) fn planned(tip: Vector, target: &TipTarget, direction: Vector) -> Self {
        Self {
            asked_mm: components(tip, 100.0),
            tool: components(direction, 10_000.0),
            targets_degrees: target.degrees,
            planned_mm: components(target.reached.tip, 100.0),
            planned_miss_mm: rounded(target.miss_mm),
            planned_tilt_degrees: rounded(target.tilt_degrees),
            measured: None,
            direction,
        }
    }

    /// Adds the angles measured at the end.
    pub(super) fn with_measured(self, positions: Option<[u8; 7]>) -> Self {
        let [x, y, z] = self.asked_mm;
        let measured = positions.map(|positions| MeasuredTip::of(positions, Vector::new(x, y, z)));
        Self { measured, ..self }
    }
}

impl MeasuredTip {
    /// From the joint angles in degrees, joint 1 first, and the requested tip.
    pub(super) fn of(positions_degrees: [u8; 7], asked: Vector) -> Self {
        let tip = TipPose::of(positions_degrees.map(Angle::from_register)).tip;
        Self { positions_degrees, tip_mm: components(tip, 100.0), miss_mm: rounded((tip - asked).length()) }
    }

    pub(super) fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "reached  {} mm, {:.1} mm from the point", point(self.tip_mm), self.miss_mm)
    }
}

/// Rounds to hundredths.
pub(super) fn rounded(number: f64) -> f64 {
    (number * 100.0).round() / 100.0
}

fn point([x, y, z]: [f64; 3]) -> PointText {
    PointText(Vector::new(x, y, z))
}

impl Printable for TipMove {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "tool     {}", DirectionText(self.direction))?;
        let joints = self.targets_degrees.map(|degrees| degrees.to_string()).join(" ");
        writeln!(out, "joints   {joints} _ _ degrees")?;
        let Self { planned_miss_mm, planned_tilt_degrees, .. } = self;
        writeln!(
            out,
            "target   {} mm: whole degrees miss the point by {planned_miss_mm:.1} mm and tilt the tool by \
             {planned_tilt_degrees:.1}°",
            point(self.planned_mm)
        )?;
        self.measured.as_ref().map_or(Ok(()), |measured| measured.write_text(out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sevenbot::cartesian::DOWN;

    #[test]
    fn the_miss_of_whole_degrees_is_told_and_then_what_was_measured() {
        let tip = Vector::new(-50.0, 185.0, 50.0);
        let target = TipTarget::of(tip, DOWN).expect("within reach");
        let arrival = TipMove::planned(tip, &target, DOWN);
        assert_eq!(arrival.targets_degrees, [105, 88, 110, 90, 135]);
        let arrival = arrival.with_measured(Some([105, 88, 110, 90, 135, 90, 80]));
        let mut text = Vec::new();
        arrival.write_text(&mut text).expect("memory");
        let text = String::from_utf8(text).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "tool     straight down (0 0 -1)");
        assert_eq!(lines[1], "joints   105 88 110 90 135 _ _ degrees");
        assert!(lines[2].contains("whole degrees miss the point by 0."), "{text}");
        assert!(lines[3].starts_with("reached  -49.6 185"), "{text}");
    }
}
