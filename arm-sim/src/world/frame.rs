//! The position and the orientation of a rigid body.

use kinematics::{Float, Vector};

/// A point in mm, or a direction.
pub(super) type Point = Vector<f64>;

pub(super) const UP: Point = Vector { x: 0.0, y: 0.0, z: 1.0 };

/// A point and three directions at right angles to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SolidFrame {
    /// Its origin, in mm.
    pub origin: Vector<f64>,
    /// The direction of its x axis.
    pub x: Vector<f64>,
    /// The direction of its y axis.
    pub y: Vector<f64>,
    /// The direction of its z axis.
    pub z: Vector<f64>,
}

impl SolidFrame {
    /// An upright frame, rotated about z by `turn` degrees, anticlockwise seen from above.
    pub(super) fn upright(origin: Point, turn: f64) -> Self {
        let (sine, cosine) = Float::sin_cos(turn);
        let x = Vector::new(cosine, sine, 0.0);
        Self { origin, x, y: UP.cross(x), z: UP }
    }

    /// Converts a point from this frame to the frame of the arm.
    pub(super) fn point(&self, local: Point) -> Point {
        self.origin + self.direction(local)
    }

    /// Converts a direction from this frame to the frame of the arm.
    fn direction(&self, Vector { x, y, z }: Point) -> Point {
        self.x * x + self.y * y + self.z * z
    }

    /// Converts a point from the frame of the arm to this frame.
    pub(super) fn local(&self, point: Point) -> Point {
        self.local_direction(point - self.origin)
    }

    fn local_direction(&self, direction: Point) -> Point {
        Vector::new(direction.dot(self.x), direction.dot(self.y), direction.dot(self.z))
    }

    /// Converts this frame from the frame of the arm to the frame `other`.
    pub(super) fn seen_from(&self, other: &Self) -> Self {
        let [x, y, z] = [self.x, self.y, self.z].map(|axis| other.local_direction(axis));
        Self { origin: other.local(self.origin), x, y, z }
    }

    /// Converts this frame from the frame `other` to the frame of the arm: the inverse of [`Self::seen_from`].
    pub(super) fn carried_by(&self, other: &Self) -> Self {
        let [x, y, z] = [self.x, self.y, self.z].map(|axis| other.direction(axis));
        Self { origin: other.point(self.origin), x, y, z }
    }

    /// The rotation about the vertical in degrees, anticlockwise seen from above.
    #[must_use]
    pub fn turn(&self) -> f64 {
        Float::atan2(self.x.y, self.x.x)
    }
}
