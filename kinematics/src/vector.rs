//! A point or a direction in space. The frame of the base: origin where the base axis meets the top plate, x to the
//! right, y forward, z up.

use core::ops::{Add, Mul, Neg, Sub};

use crate::float::Float;

/// A point in millimetres, or a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Vector<F> {
    /// To the right.
    pub x: F,
    /// Forward.
    pub y: F,
    /// Up.
    pub z: F,
}

impl<F: Float> Vector<F> {
    /// A vector: `x` to the right, `y` forward, `z` up.
    #[must_use]
    pub const fn new(x: F, y: F, z: F) -> Self {
        Self { x, y, z }
    }

    /// The dot product; 0 at right angles.
    #[must_use]
    pub fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// The cross product, at right angles to both vectors.
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// The length. Infinite where its square is too large for the type.
    #[must_use]
    pub fn length(self) -> F {
        self.dot(self).sqrt()
    }

    /// The vector of length 1 in the same direction. `None` for zero, infinity and NaN.
    #[must_use]
    pub fn unit(self) -> Option<Self> {
        let largest = self.x.abs().larger(self.y.abs()).larger(self.z.abs());
        if !self.is_finite() || largest <= F::of(0.0) {
            return None;
        }
        // Scale first: the square of a short vector may be zero, and the square of a long one infinite.
        let scaled = Self::new(self.x / largest, self.y / largest, self.z / largest);
        Some(scaled * (F::of(1.0) / scaled.length()))
    }

    /// Is no component infinite or NaN?
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

impl<F: Float> Add for Vector<F> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl<F: Float> Sub for Vector<F> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl<F: Float> Mul<F> for Vector<F> {
    type Output = Self;

    fn mul(self, factor: F) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}

impl<F: Float> Neg for Vector<F> {
    type Output = Self;

    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cross_product_is_right_handed() {
        let (x, y) = (Vector::new(1.0, 0.0, 0.0), Vector::new(0.0, 1.0, 0.0));
        assert_eq!(x.cross(y), Vector::new(0.0, 0.0, 1.0));
        assert_eq!(-y.cross(x), x.cross(y));
    }

    #[test]
    fn any_finite_vector_but_zero_has_a_direction() {
        for length in [1e-45_f32, 1e-30, 1.0, 127.0, 3e38] {
            let unit = Vector::new(0.0, -length, length).unit().expect("a direction");
            assert!((unit.length() - 1.0).abs() < 2e-7, "{length}: {unit:?}");
            assert_eq!((unit.x, -unit.y), (0.0, unit.z));
        }
    }

    #[test]
    fn zero_infinity_and_nan_have_no_direction() {
        for x in [0.0, -0.0, f64::INFINITY, f64::NAN] {
            assert_eq!(Vector::new(0.0, x, 0.0).unit(), None, "{x}");
        }
        assert_eq!(Vector::new(1.0, f64::NAN, 0.0).unit(), None);
    }
}
