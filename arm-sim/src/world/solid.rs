//! The forms of objects and walls, and their contacts with balls.

use kinematics::{Float, Vector};

use super::frame::{Point, SolidFrame};
use crate::scene::Form;

/// A form, centred on the origin of its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum Solid {
    /// Half of the edges along x, y and z, in mm.
    Box([f64; 3]),
    /// The axis is along z. Lengths are in mm.
    Cylinder { radius: f64, half_height: f64 },
}

/// The contact of a solid with a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Touch {
    /// How deep the ball is in the solid, in mm.
    pub(super) depth: f64,
    /// The direction out of the solid, of length 1.
    pub(super) normal: Point,
}

impl From<Form> for Solid {
    fn from(form: Form) -> Self {
        match form {
            Form::Cube { edge } => Self::Box([edge / 2.0; 3]),
            Form::Cylinder { diameter, height } => {
                Self::Cylinder { radius: diameter / 2.0, half_height: height / 2.0 }
            }
        }
    }
}

impl Solid {
    pub(super) const fn half_height(self) -> f64 {
        match self {
            Self::Box([_, _, half]) => half,
            Self::Cylinder { half_height, .. } => half_height,
        }
    }

    /// The radius of the largest circle in it, seen from above while it is upright.
    pub(super) const fn inner_radius(self) -> f64 {
        match self {
            Self::Box([x, y, _]) => x.min(y),
            Self::Cylinder { radius, .. } => radius,
        }
    }

    /// How far the solid reaches from its middle in this direction, in mm.
    pub(super) fn reach(self, frame: &SolidFrame, direction: Point) -> f64 {
        let [x, y, z] = [frame.x, frame.y, frame.z].map(|axis| axis.dot(direction).abs());
        match self {
            Self::Box([half_x, half_y, half_z]) => half_x * x + half_y * y + half_z * z,
            Self::Cylinder { radius, half_height } => {
                radius * Float::sqrt((1.0 - z * z).max(0.0)) + half_height * z
            }
        }
    }

    /// The contact with a ball of this radius round a point, at the nearest face. `None`: they do not touch.
    pub(super) fn touch(self, frame: &SolidFrame, point: Point, ball: f64) -> Option<Touch> {
        let Vector { x, y, z } = frame.local(point);
        let above = |value: f64, axis: Point| if value < 0.0 { -axis } else { axis };
        let faces = match self {
            Self::Box([half_x, half_y, half_z]) => [
                (x.abs() - half_x, above(x, frame.x)),
                (y.abs() - half_y, above(y, frame.y)),
                (z.abs() - half_z, above(z, frame.z)),
            ],
            Self::Cylinder { radius, half_height } => {
                let from_axis = Float::sqrt(x * x + y * y);
                let outward = (frame.x * x + frame.y * y).unit().unwrap_or(frame.x);
                let round = (from_axis - radius, outward);
                [round, round, (z.abs() - half_height, above(z, frame.z))]
            }
        };
        let [first, rest @ ..] = faces;
        let (distance, normal) =
            rest.into_iter().fold(first, |one, other| if other.0 > one.0 { other } else { one });
        (distance < ball).then_some(Touch { depth: ball - distance, normal })
    }

    /// The corners, for contacts with other solids. For a cylinder: the corners of the largest box with a square base inside it.
    pub(super) fn corners(self, frame: &SolidFrame) -> [Point; 8] {
        let [x, y, z] = match self {
            Self::Box(half) => half,
            Self::Cylinder { radius, half_height } => {
                let side = radius * core::f64::consts::FRAC_1_SQRT_2;
                [side, side, half_height]
            }
        };
        let signs = |bit: u32, half: f64, number: u32| if number >> bit & 1 == 0 { half } else { -half };
        core::array::from_fn(|index| {
            let number = u32::try_from(index).unwrap_or(0);
            frame.point(Vector::new(signs(0, x, number), signs(1, y, number), signs(2, z, number)))
        })
    }
}
