//! Axes of plots: chooses round numbers, and maps values to positions.

/// The range of values of an axis, and the step of its ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueAxis {
    /// The value at the lower end, a multiple of `step`.
    pub low: f32,
    /// The value at the upper end, a multiple of `step`.
    pub high: f32,
    /// The difference between two ticks.
    pub step: f32,
}

impl ValueAxis {
    /// An axis with zero in the middle, which contains all finite values and at least `-least` to `least`. Its step is round: 1,
    /// 2 or 5 times a power of ten. Its ends are multiples of the step. At most `most_steps` steps are between them, unless
    /// rounding adds one at each end.
    #[must_use]
    pub fn around_zero(values: impl Iterator<Item = f32>, least: f32, most_steps: f32) -> Self {
        let largest = values.filter(|value| value.is_finite()).map(f32::abs).fold(least, f32::max);
        let step = round_step(2.0 * largest / most_steps.max(2.0));
        let end = (largest / step).ceil() * step;
        Self { low: -end, high: end, step }
    }

    /// The values of the ticks, lowest first.
    pub fn ticks(&self) -> impl Iterator<Item = f32> {
        let (low, high, step) = (self.low, self.high, self.step);
        let ticks = std::iter::successors(Some(0_u8), |tick| tick.checked_add(1));
        ticks
            .map(move |tick| low + f32::from(tick) * step)
            .take_while(move |value| *value <= high + step / 1e3)
    }

    /// The position of a value on the axis: 0 at the low end, 1 at the high end. Values beyond an end are clamped to it.
    #[must_use]
    pub fn place(&self, value: f32) -> f32 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }
}

/// The smallest number of the form 1, 2 or 5 times a power of ten that is at least `least`, less 0.1 % for rounding errors.
fn round_step(least: f32) -> f32 {
    let power = 10.0_f32.powf(least.max(1e-6).log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= least * 0.999);
    factor.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_holds_all_values_and_has_round_numbers() {
        for (largest, least, wanted) in [
            (0.0, 10.0, [10.0, 5.0]),
            (37.0, 10.0, [40.0, 20.0]),
            (-372.0, 10.0, [400.0, 200.0]),
            (99.0, 1.0, [100.0, 50.0]),
        ] {
            let axis = ValueAxis::around_zero([largest, f32::NAN].into_iter(), least, 4.0);
            assert_eq!([axis.high, axis.step], wanted, "{largest}");
            let ticks: Vec<f32> = axis.ticks().collect();
            assert!(ticks.len() >= 3 && ticks.len() <= 5 && ticks.contains(&0.0), "{ticks:?}");
            assert_eq!((ticks.first(), ticks.last()), (Some(&axis.low), Some(&axis.high)));
        }
    }

    #[test]
    fn a_value_has_a_place_and_stays_within_the_plot() {
        let axis = ValueAxis { low: -50.0, high: 150.0, step: 50.0 };
        assert_eq!([-50.0, 50.0, 150.0, 999.0].map(|value| axis.place(value)), [0.0, 0.5, 1.0, 1.0]);
    }

    #[test]
    fn steps_are_round() {
        let steps = [0.3, 1.0, 1.1, 4.0, 6.0, 70.0].map(round_step);
        for (step, wanted) in steps.into_iter().zip([0.5, 1.0, 2.0, 5.0, 10.0, 100.0]) {
            assert!((step - wanted).abs() < 1e-4 * wanted, "{step} {wanted}");
        }
    }
}
