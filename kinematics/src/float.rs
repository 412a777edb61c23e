//! Floating point on chip and host. Only exactly rounded operations and `libm` are used: all machines get the same bits.
//!
//! The angles of the joints are degrees, so sine and cosine take degrees. They are exact at multiples of 90 from -180 to 180.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// The number type of positions and angles: `f32` in the controller, also a simulated one, `f64` in other programs of the host.
pub trait Float:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The distance from 1 to the next larger number.
    const EPSILON: Self;

    /// The nearest number of this type.
    #[must_use]
    fn of(value: f64) -> Self;
    /// Is this neither infinite nor NaN?
    #[must_use]
    fn is_finite(self) -> bool;
    /// The magnitude; 0 for -0.
    #[must_use]
    fn abs(self) -> Self;
    /// The square root; NaN for a number below 0.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The angle of the point (`x`, `self`) in radians, -pi to pi.
    #[must_use]
    fn atan2_radians(self, x: Self) -> Self;

    /// The larger of two numbers; `other` where they are equal, so -0 becomes 0 if `other` is 0. The `max` of the
    /// standard library gives either zero, depending on the machine.
    #[must_use]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// Sine and cosine of an angle in degrees. Outside -225 to 225 degrees the result is less exact.
    #[must_use]
    fn sin_cos(self) -> (Self, Self) {
        let degrees = self.abs();
        let (sine, cosine) = if degrees > Self::of(135.0) {
            let (sine, cosine) = sin_cos_to_45(Self::of(180.0) - degrees);
            (sine, -cosine)
        } else if degrees > Self::of(45.0) {
            let (sine, cosine) = sin_cos_to_45(Self::of(90.0) - degrees);
            (cosine, sine)
        } else {
            sin_cos_to_45(degrees)
        };
        (if self < Self::of(0.0) { -sine } else { sine }, cosine)
    }

    /// The angle of the point (`x`, `self`) in degrees, -180 to 180.
    #[must_use]
    fn atan2(self, x: Self) -> Self {
        self.atan2_radians(x) * Self::of(180.0 / core::f64::consts::PI)
    }
}

/// Sine and cosine of at most 45 degrees by their Taylor series, up to the 16th power: what is left out is below the
/// rounding of `f64`. The functions of `libm` compute with `f64` even for `f32`. The chip does that in software:
/// `forward` would take 14,538 instructions instead of 899, and 6 KiB more flash.
fn sin_cos_to_45<F: Float>(degrees: F) -> (F, F) {
    let one = F::of(1.0);
    let radians = degrees * F::of(core::f64::consts::PI / 180.0);
    let square = radians * radians;
    // Each term of the series is the previous term times -square / (n (n + 1)).
    let term = |n: f64, rest: F| one - square * F::of(1.0 / (n * (n + 1.0))) * rest;
    let cosine =
        term(1.0, term(3.0, term(5.0, term(7.0, term(9.0, term(11.0, term(13.0, term(15.0, one))))))));
    let sine = term(2.0, term(4.0, term(6.0, term(8.0, term(10.0, term(12.0, term(14.0, one)))))));
    (radians * sine, cosine)
}

impl Float for f32 {
    const EPSILON: Self = Self::EPSILON;

    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounds to the nearest f32, which is what is asked for"
    )]
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as Self
    }

    fn is_finite(self) -> bool {
        self.is_finite()
    }

    fn abs(self) -> Self {
        self.abs()
    }

    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }

    fn atan2_radians(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }
}

impl Float for f64 {
    const EPSILON: Self = Self::EPSILON;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    fn is_finite(self) -> bool {
        self.is_finite()
    }

    fn abs(self) -> Self {
        self.abs()
    }

    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }

    fn atan2_radians(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multiples_of_90_degrees_are_exact() {
        let wanted =
            [(-180.0, -0.0, -1.0), (-90.0, -1.0, 0.0), (0.0, 0.0, 1.0), (90.0, 1.0, 0.0), (180.0, 0.0, -1.0)];
        for (degrees, sine, cosine) in wanted {
            assert_eq!(Float::sin_cos(degrees), (sine, cosine));
            assert_eq!(Float::sin_cos(f32::of(degrees)), (f32::of(sine), f32::of(cosine)));
        }
    }

    #[test]
    fn sine_and_cosine_are_those_of_the_standard_library() {
        for tenth in -2250..=2250 {
            let degrees = f64::from(tenth) / 10.0;
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let (exact_sine, exact_cosine) = Float::sin_cos(degrees);
            assert!((exact_sine - sine).abs() < 1e-15 && (exact_cosine - cosine).abs() < 1e-15, "{degrees}");
            let (short_sine, short_cosine) = Float::sin_cos(f32::of(degrees));
            let worst = (f64::from(short_sine) - sine).abs().max((f64::from(short_cosine) - cosine).abs());
            assert!(worst < 2e-7, "{degrees} in f32: {worst}");
        }
    }

    #[test]
    fn quarter_turns_are_exact_degrees() {
        assert_eq!([1.0_f32.atan2(0.0), Float::atan2(1.0_f32, 0.0)], [core::f32::consts::FRAC_PI_2, 90.0]);
        assert_eq!((Float::atan2(0.0, -1.0), Float::atan2(0.0_f32, -1.0)), (180.0, 180.0));
        assert_eq!((Float::atan2(-0.0, -1.0), Float::atan2(-1.0_f32, 0.0)), (-180.0, -90.0));
    }
}
