//! The output of `move-to`.

use std::io::{self, Write};

use serde::Serialize;
use sevenbot::FineAngle;
use sevenbot::cartesian::{DirectionText, FineTipTarget, PointText, TipTarget, Vector};

use super::super::position::components;
use crate::measured_pose::{MeasuredPose, PositionDegrees};
use crate::printer::Printable;

/// A move to a point: the plan, and with --wait the measured result.
#[derive(Debug, Serialize)]
pub(super) struct TipArrival {
    asked_mm: [f64; 3],
    /// The requested direction of the tool, of length 1.
    tool: [f64; 3],
    /// Joints 1 to 5.
    targets_degrees: TargetDegrees,
    planned_mm: [f64; 3],
    planned_miss_mm: f64,
    planned_tilt_degrees: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<MeasuredTip>,
    #[serde(skip)]
    direction: Vector,
}

/// Angles of joints 1 to 5, as the arm takes them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
enum TargetDegrees {
    Whole([u8; 5]),
    Hundredths([f64; 5]),
}

impl TargetDegrees {
    fn texts(self) -> [String; 5] {
        match self {
            Self::Whole(degrees) => degrees.map(|degrees| degrees.to_string()),
            Self::Hundredths(degrees) => degrees.map(|degrees| format!("{degrees:.2}")),
        }
    }

    /// The text for the rounding of the targets, and the number of decimals of a miss.
    const fn rounding(self) -> (&'static str, usize) {
        match self {
            Self::Whole(_) => ("whole degrees miss", 1),
            Self::Hundredths(_) => ("hundredths of a degree miss", 2),
        }
    }
}

/// The arm at the end of a move.
#[derive(Debug, Serialize)]
pub(super) struct MeasuredTip {
    positions_degrees: PositionDegrees,
    tip_mm: [f64; 3],
    miss_mm: f64,
}

impl TipArrival {
    /// A move that is planned and not made yet, with targets in whole degrees.
    pub(super) fn planned(tip: Vector, target: &TipTarget, direction: Vector) -> Self {
        Self {
            asked_mm: components(tip, 100.0),
            tool: components(direction.unit().unwrap_or(direction), 10_000.0),
            targets_degrees: TargetDegrees::Whole(target.degrees),
            planned_mm: components(target.reached.tip, 100.0),
            planned_miss_mm: rounded(target.miss_mm),
            planned_tilt_degrees: rounded(target.tilt_degrees),
            measured: None,
            direction,
        }
    }

    /// Replaces the targets in whole degrees by targets in hundredths of a degree.
    pub(super) fn in_hundredths(self, target: &FineTipTarget) -> Self {
        Self {
            targets_degrees: TargetDegrees::Hundredths(target.angles.map(FineAngle::degrees)),
            planned_mm: components(target.reached.tip, 100.0),
            planned_miss_mm: rounded(target.miss_mm),
            planned_tilt_degrees: rounded(target.tilt_degrees),
            ..self
        }
    }

    /// Adds the angles measured at the end.
    pub(super) fn with_measured(self, positions: Option<MeasuredPose>) -> Self {
        let [x, y, z] = self.asked_mm;
        let measured = positions.map(|positions| MeasuredTip::of(positions, Vector::new(x, y, z)));
        Self { measured, ..self }
    }
}

impl MeasuredTip {
    /// The end of a move to the point `asked`, from the measured angles.
    pub(super) fn of(pose: MeasuredPose, asked: Vector) -> Self {
        let (positions_degrees, tip) = (pose.degrees(), pose.tip_pose().tip);
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

impl Printable for TipArrival {
    fn write_text(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "tool     {}", DirectionText(self.direction))?;
        let joints = self.targets_degrees.texts().join(" ");
        let (misses, decimals) = self.targets_degrees.rounding();
        writeln!(out, "joints   {joints} _ _ degrees")?;
        let Self { planned_miss_mm, planned_tilt_degrees, .. } = self;
        writeln!(
            out,
            "target   {} mm: {misses} the point by {planned_miss_mm:.decimals$} mm and tilt the tool by \
             {planned_tilt_degrees:.decimals$}°",
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
        let arrival = TipArrival::planned(tip, &target, DOWN);
        assert_eq!(arrival.targets_degrees, TargetDegrees::Whole([105, 88, 110, 90, 135]));
        let arrival = arrival.with_measured(Some(MeasuredPose::whole([105, 88, 110, 90, 135, 90, 80])));
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
