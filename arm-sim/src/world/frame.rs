//! Where a rigid thing is, and which way it is turned.

use kinematics::{Float, Vector};

/// A point or a direction in mm.
pub(super) type Point = Vector<f64>;

pub(super) const UP: Point = Vector { x: 0.0, y: 0.0, z: 1.0 };

/// A point and three directions at right angles to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Frame {
    /// Its origin, in mm.
    pub origin: Vector<f64>,
    /// The direction of its x axis.
    pub x: Vector<f64>,
    /// The direction of its y axis.
    pub y: Vector<f64>,
    /// The direction of its z axis.
    pub z: Vector<f64>,
}

impl Frame {
    /// Upright, and turned to the left by this angle in degrees.
    pub(super) fn upright(origin: Point, turn: f64) -> Self {
        let (sine, cosine) = Float::sin_cos(turn);
        let x = Vector::new(cosine, sine, 0.0);
        Self { origin, x, y: UP.cross(x), z: UP }
    }

    /// A point in its axes, in the frame of the arm.
    pub(super) fn point(&self, local: Point) -> Point {
        self.origin + self.direction(local)
    }

    /// A direction in its axes, in the frame of the arm.
    fn direction(&self, Vector { x, y, z }: Point) -> Point {
        self.x * x + self.y * y + self.z * z
    }

    /// A point of the arm's frame, in these axes.
    pub(super) fn local(&self, point: Point) -> Point {
        self.local_direction(point - self.origin)
    }

    fn local_direction(&self, direction: Point) -> Point {
        Vector::new(direction.dot(self.x), direction.dot(self.y), direction.dot(self.z))
    }

    /// This frame, seen from another one.
    pub(super) fn seen_from(&self, other: &Self) -> Self {
        let [x, y, z] = [self.x, self.y, self.z].map(|axis| other.local_direction(axis));
        Self { origin: other.local(self.origin), x, y, z }
    }

    /// The frame of which this one was seen from `other`.
    pub(super) fn carried_by(&self, other: &Self) -> Self {
        let [x, y, z] = [self.x, self.y, self.z].map(|axis| other.direction(axis));
        Self { origin: other.point(self.origin), x, y, z }
    }

    /// How far it is turned to the left, seen from above, in degrees.
    #[must_use]
    pub fn turn(&self) -> f64 {
        Float::atan2(self.x.y, self.x.x)
    }
}
