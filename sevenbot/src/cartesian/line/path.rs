//! Tip and tool along a straight line. The tip moves and the tool turns at constant speed.

use super::super::{TipPose, Vector, angle_between};

/// A line from one pose of the tip to another.
#[derive(Clone, Copy, Debug)]
pub(super) struct TipPath {
    start: TipPose,
    /// From the start to the end.
    way: Vector,
    /// The direction of the turn, at right angles to the tool at the start.
    towards: Vector,
    /// In millimetres.
    pub(super) length: f64,
    pub(super) turn_degrees: f64,
}

impl TipPath {
    /// The path to `tip`. `tool` has length 1.
    pub(super) fn new(start: TipPose, tip: Vector, tool: Vector) -> Self {
        let way = tip - start.tip;
        let turn_degrees = angle_between(start.tool, tool);
        let beside = tool - start.tool * start.tool.dot(tool);
        // A half turn can go in any direction. The tool turns upwards, or forward if it starts nearly vertical.
        let other =
            if start.tool.z.abs() < 0.9 { Vector::new(0.0, 0.0, 1.0) } else { Vector::new(0.0, 1.0, 0.0) };
        let other = other - start.tool * start.tool.dot(other);
        let beside = if beside.length() > 1e-9 { beside } else { other };
        let towards = beside.unit().unwrap_or(other);
        Self { start, way, towards, length: way.length(), turn_degrees }
    }

    /// Tip and tool at this fraction of the line, 0 to 1.
    pub(super) fn at(&self, share: f64) -> (Vector, Vector) {
        let (sine, cosine) = (self.turn_degrees * share).to_radians().sin_cos();
        (self.start.tip + self.way * share, self.start.tool * cosine + self.towards * sine)
    }

    /// The distance of a point from the line, in millimetres.
    pub(super) fn distance(&self, point: Vector) -> f64 {
        let from_start = point - self.start.tip;
        let square = self.way.dot(self.way);
        let share = if square > 0.0 { (from_start.dot(self.way) / square).clamp(0.0, 1.0) } else { 0.0 };
        (from_start - self.way * share).length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(tool: Vector) -> TipPath {
        let start = TipPose::at([90.0, 90.0, 65.0, 90.0, 90.0, 90.0]);
        TipPath::new(start, start.tip + Vector::new(100.0, 0.0, 0.0), tool)
    }

    #[test]
    fn tip_and_tool_move_evenly() {
        let path = path(Vector::new(0.0, 0.0, -1.0));
        assert_eq!((path.length, path.turn_degrees), (100.0, 90.0));
        let (tip, tool) = path.at(0.5);
        assert_eq!(tip.x, 50.0);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!((tool - Vector::new(0.0, half, -half)).length() < 1e-12, "{tool:?}");
        assert!((path.at(1.0).1 - Vector::new(0.0, 0.0, -1.0)).length() < 1e-12);
    }

    #[test]
    fn half_a_turn_goes_through_the_vertical() {
        let path = path(Vector::new(0.0, -1.0, 0.0));
        assert!((path.at(0.5).1 - Vector::new(0.0, 0.0, 1.0)).length() < 1e-9);
        assert!((path.at(1.0).1 - Vector::new(0.0, -1.0, 0.0)).length() < 1e-9);
    }

    #[test]
    fn distances_are_from_the_line_and_from_its_ends() {
        let path = path(Vector::new(0.0, 1.0, 0.0));
        let (tip, _) = path.at(0.0);
        assert_eq!(path.distance(tip + Vector::new(50.0, 0.0, 3.0)), 3.0);
        assert_eq!(path.distance(tip + Vector::new(-4.0, 0.0, 3.0)), 5.0);
    }
}
