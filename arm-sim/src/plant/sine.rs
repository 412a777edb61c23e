//! Sine in integers. Unlike the sine of a system library, it has the same value on every machine.

/// The value that stands for 1 in results of [`sine`].
pub(crate) const ONE: i64 = 1_000_000;

/// Thousandths of a degree in a quarter turn.
const QUARTER: i64 = 90_000;

/// The sine of an angle in thousandths of a degree, in millionths. The error is below 200 millionths.
pub(crate) const fn sine(millidegrees: i64) -> i64 {
    // Fold the angle into -90 to 90 degrees.
    let turned = (millidegrees + QUARTER).rem_euclid(4 * QUARTER) - QUARTER;
    let folded = if turned > QUARTER { 2 * QUARTER - turned } else { turned };
    let z = folded * ONE / QUARTER;
    let square = z * z / ONE;
    // sin(z * 90 degrees) is about z * (A - B * z^2 + C * z^4); A - B + C is 1.
    const A: i64 = 1_570_629;
    const B: i64 = 643_230;
    const C: i64 = ONE - A + B;
    let factor = A + (C * square / ONE - B) * square / ONE;
    z * factor / ONE
}

/// The cosine of an angle in thousandths of a degree, in millionths.
pub(crate) const fn cosine(millidegrees: i64) -> i64 {
    sine(millidegrees + QUARTER)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quarters_are_exact() {
        let quarters = [-180, -90, 0, 90, 180, 270, 360, 450].map(|degrees| sine(degrees * 1_000));
        assert_eq!(quarters, [0, -ONE, 0, ONE, 0, -ONE, 0, ONE]);
        assert_eq!([cosine(0), cosine(90_000), cosine(180_000)], [ONE, 0, -ONE]);
    }

    #[test]
    fn every_angle_is_within_200_millionths() {
        for millidegrees in (-400_000_i32..=400_000).step_by(7) {
            let wanted = f64::from(millidegrees).to_radians() / 1_000.0;
            let error = sine(i64::from(millidegrees)) as f64 / 1e6 - wanted.sin();
            assert!(error.abs() < 200e-6, "{millidegrees} thousandths of a degree: off by {error}");
        }
    }
}
