//! Converts degrees of a joint to counts of its servo, and back.
//!
//! ```text
//!   counts = a × k + s - offset × k        a = angle, or 180° - angle where the servo is mounted reversed
//!                                          k = counts per degree, s = counts at a = 0
//! ```
//!
//! The constants come from the maker's published firmware. As in that firmware, the offset
//! ([D9](protocol_core::decisions#d9)) applies on the servo's side of the reversal. The arithmetic uses thousandths of
//! a degree in 32-bit integers; one count is 212 or 288 of them. This file does not know targets.

use protocol_core::registers::Joint;

/// An angle in millionths of a degree, the unit of joint positions in this crate ([D18](protocol_core::decisions#d18)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MicroDegrees(pub i32);

impl MicroDegrees {
    const PER_DEGREE: i32 = 1_000_000;
    const PER_CENTIDEGREE: i32 = 10_000;

    /// The angle of this many whole degrees.
    #[must_use]
    pub const fn from_degrees(degrees: u8) -> Self {
        // `as` widens here: `From` is not const.
        Self(degrees as i32 * Self::PER_DEGREE)
    }

    /// The nearest angle to this many degrees. It saturates beyond 2147 degrees in either direction.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "the conversion saturates")]
    pub fn nearest(degrees: f32) -> Self {
        let scaled = degrees * 1e6;
        Self((if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 }) as i32)
    }

    /// The value of a position register: the nearest degree, 0 to 180 ([D18](protocol_core::decisions#d18)).
    #[must_use]
    pub fn nearest_degree(self) -> u8 {
        let degrees = rounded::<{ Self::PER_DEGREE }>(self.0.clamp(0, 180 * Self::PER_DEGREE));
        u8::try_from(degrees).unwrap_or(180)
    }

    /// The angle of this many hundredths of a degree.
    #[must_use]
    pub fn from_centidegrees(centidegrees: u16) -> Self {
        Self(i32::from(centidegrees) * Self::PER_CENTIDEGREE)
    }

    /// The value of a fine position register: the nearest hundredth of a degree, 0 to 18000
    /// ([D21](protocol_core::decisions#d21)).
    #[must_use]
    pub fn nearest_centidegree(self) -> u16 {
        let limited = self.0.clamp(0, 180 * Self::PER_DEGREE);
        u16::try_from(rounded::<{ Self::PER_CENTIDEGREE }>(limited)).unwrap_or(18_000)
    }
}

/// The highest position of a servo, in counts.
const MAX_COUNTS: i32 = 1023;
/// Limit on a servo's velocity, in counts per second: far above the highest one, 1757, and low enough for 32-bit products.
const MAX_VELOCITY: i32 = 10_000;
/// Thousandths of a degree in half a turn.
const HALF_TURN: i32 = 180_000;

/// How many counts a servo has in half a turn.
#[derive(Clone, Copy)]
enum Scale {
    Counts850,
    Counts625,
}

/// How one joint's servo is mounted.
struct Mounting {
    scale: Scale,
    /// Counts at a = 0.
    zero: i32,
    reversed: bool,
}

impl Scale {
    fn counts(self, millidegrees: i32) -> i32 {
        match self {
            Self::Counts850 => rounded::<HALF_TURN>(millidegrees * 850),
            Self::Counts625 => rounded::<HALF_TURN>(millidegrees * 625),
        }
    }

    fn millidegrees(self, counts: i32) -> i32 {
        match self {
            Self::Counts850 => rounded::<850>(counts * HALF_TURN),
            Self::Counts625 => rounded::<625>(counts * HALF_TURN),
        }
    }
}

impl Mounting {
    const fn of(joint: Joint) -> Self {
        use Scale::{Counts625, Counts850};
        let (scale, zero, reversed) = match joint.number() {
            1 => (Counts850, 86, false),
            2 => (Counts850, 20, true),
            3 => (Counts850, 141, true),
            4 => (Counts850, 86, true),
            5 | 6 => (Counts625, 199, true),
            _ => (Counts625, 730, false),
        };
        Self { scale, zero, reversed }
    }

    /// Converts an angle across the reversal, in either direction.
    const fn reverse(&self, millidegrees: i32) -> i32 {
        if self.reversed { HALF_TURN - millidegrees } else { millidegrees }
    }
}

/// The servo position for an angle of a joint, limited to 0 to 1023 counts. `offset_degrees` is the joint's
/// offset.
#[must_use]
pub fn counts_from_angle(joint: Joint, angle: MicroDegrees, offset_degrees: i8) -> u16 {
    let mounting = Mounting::of(joint);
    let on_servo_side = mounting.reverse(rounded::<1_000>(angle.0)) - i32::from(offset_degrees) * 1_000;
    let counts = mounting.zero + mounting.scale.counts(on_servo_side);
    u16::try_from(counts.clamp(0, MAX_COUNTS)).unwrap_or(0)
}

/// The angle of a joint whose servo is at `counts`, limited to 1023. The angle may lie outside 0 to 180 degrees.
#[must_use]
pub fn angle_from_counts(joint: Joint, counts: u16, offset_degrees: i8) -> MicroDegrees {
    let mounting = Mounting::of(joint);
    let counts = i32::from(counts).min(MAX_COUNTS);
    let seen = mounting.scale.millidegrees(counts - mounting.zero) + i32::from(offset_degrees) * 1_000;
    MicroDegrees(mounting.reverse(seen) * 1_000)
}

/// The velocity of a joint in tenths of a degree per second, positive towards greater angles. `velocity` is the
/// velocity of the servo in counts per second.
#[must_use]
pub fn velocity_from_servo(joint: Joint, velocity: i16) -> i16 {
    let mounting = Mounting::of(joint);
    let counts = i32::from(velocity).clamp(-MAX_VELOCITY, MAX_VELOCITY);
    let velocity = rounded::<100>(mounting.scale.millidegrees(counts));
    i16::try_from(if mounting.reversed { -velocity } else { velocity }).unwrap_or(0)
}

/// The load of a joint, positive towards greater angles. `load` is the load of the servo, positive towards more counts.
#[must_use]
pub const fn load_from_servo(joint: Joint, load: i16) -> i16 {
    if Mounting::of(joint).reversed { load.saturating_neg() } else { load }
}

/// The push of a joint in 0.1 % of the stall torque, positive towards greater angles: the load of its servo less what its
/// speed needs, 100 % at 372 degrees/s ([D27](protocol_core::decisions#d27)). `speed` is in counts per second.
#[must_use]
pub fn push_from_servo(joint: Joint, load: i16, speed: i16) -> i16 {
    let mounting = Mounting::of(joint);
    // The load that the speed needs, in 0.1 % per count per second, times 1024: 1000 / 1757 or 1000 / 1292. 1757 and 1292
    // counts per second are 372 degrees/s.
    let share = match mounting.scale {
        Scale::Counts850 => 583,
        Scale::Counts625 => 793,
    };
    let push = i32::from(load) - i32::from(speed) * share / 1_024;
    i16::try_from(if mounting.reversed { -push } else { push }).unwrap_or(0)
}

/// `number` / `DIVISOR`, rounded to the nearest integer. The divisor is a constant, so the division cannot panic.
fn rounded<const DIVISOR: i32>(number: i32) -> i32 {
    number.saturating_add(DIVISOR / 2).div_euclid(DIVISOR)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(number: u8) -> Joint {
        Joint::new(number).unwrap()
    }

    fn counts(number: u8, degrees: u8, offset: i8) -> u16 {
        counts_from_angle(joint(number), MicroDegrees::from_degrees(degrees), offset)
    }

    /// Calculated by hand: 850 / 180 = 4.7222, 625 / 180 = 3.4722 counts a degree.
    #[test]
    fn golden_counts_of_every_joint() {
        assert_eq!([counts(1, 0, 0), counts(1, 90, 0), counts(1, 180, 0)], [86, 511, 936]);
        assert_eq!([counts(2, 0, 0), counts(2, 90, 0), counts(2, 180, 0)], [870, 445, 20]);
        assert_eq!([counts(3, 0, 0), counts(3, 65, 0), counts(3, 180, 0)], [991, 684, 141]);
        assert_eq!([counts(4, 0, 0), counts(4, 90, 0), counts(4, 180, 0)], [936, 511, 86]);
        for wrist in [5, 6] {
            // The 511.5 counts of 90 degrees round up.
            assert_eq!([counts(wrist, 0, 0), counts(wrist, 90, 0), counts(wrist, 180, 0)], [824, 512, 199]);
        }
        assert_eq!([counts(7, 0, 0), counts(7, 80, 0), counts(7, 180, 0)], [730, 1008, 1023]);
    }

    #[test]
    fn golden_counts_with_offsets() {
        // Ten degrees of offset are 47.2 or 34.7 counts less, whether or not the servo is reversed (D9).
        assert_eq!([counts(1, 90, 10), counts(1, 90, -10)], [464, 558]);
        assert_eq!([counts(2, 90, 10), counts(2, 90, -10)], [398, 492]);
        assert_eq!([counts(7, 40, 10), counts(7, 40, -10)], [834, 904]);
    }

    #[test]
    fn d21_golden_velocities() {
        let velocity = |number, counts| velocity_from_servo(joint(number), counts);
        assert_eq!([velocity(1, 850), velocity(1, -850), velocity(2, 850)], [1_800, -1_800, -1_800]);
        assert_eq!([velocity(5, 625), velocity(7, 625), velocity(1, 1)], [-1_800, 1_800, 2]);
        assert_eq!([velocity(1, i16::MAX), velocity(2, i16::MIN)], [21_176, 21_176], "limited");
    }

    #[test]
    fn d21_hundredths_of_a_degree_are_rounded_to_the_nearest() {
        let shown = [-1, 4_999, 5_000, 123_456_789, 179_995_000, 181_000_000]
            .map(|angle| MicroDegrees(angle).nearest_centidegree());
        assert_eq!(shown, [0, 0, 1, 12_346, 18_000, 18_000]);
        for centidegrees in 0..=18_000 {
            assert_eq!(MicroDegrees::from_centidegrees(centidegrees).nearest_centidegree(), centidegrees);
        }
    }

    #[test]
    fn golden_angles() {
        let angle = |number, counts, offset| angle_from_counts(joint(number), counts, offset).0;
        assert_eq!(angle(1, 511, 0), 90_000_000);
        assert_eq!(angle(1, 512, 0), 90_212_000, "a count is 0.2118 degrees");
        assert_eq!(angle(2, 446, 0), 89_788_000, "reversed: more counts, fewer degrees");
        assert_eq!(angle(7, 731, 0), 288_000, "a count is 0.288 degrees");
        assert_eq!(angle(1, 511, 5), 95_000_000, "angle seen = servo angle + offset (D9)");
        assert_eq!(angle(2, 445, 5), 85_000_000, "but on the servo's side of the reversal");
        assert_eq!(angle(1, 0, 0), -18_212_000, "not clamped");
        assert_eq!(angle(1, u16::MAX, 0), angle(1, 1023, 0));
    }

    #[test]
    fn every_degree_survives_conversion_within_the_range_of_the_servo() {
        for joint in Joint::ALL {
            for (degrees, offset) in
                (0..=180).flat_map(|degrees| (-16..=16).map(move |offset| (degrees, offset)))
            {
                let counts = counts_from_angle(joint, MicroDegrees::from_degrees(degrees), offset);
                if counts == 0 || counts == 1023 {
                    let ends_early = joint.number() == 7 && degrees > 67;
                    assert!(ends_early || [2, 3].contains(&joint.number()) && offset != 0, "{joint:?}");
                    continue;
                }
                let back = angle_from_counts(joint, counts, offset).nearest_degree();
                assert_eq!(back, degrees, "{joint:?} at {degrees} degrees, offset {offset}: {counts} counts");
            }
        }
    }

    #[test]
    fn the_claw_reaches_its_last_count_at_about_84_degrees() {
        assert_eq!([counts(7, 84, 0), counts(7, 85, 0)], [1022, 1023]);
        assert_eq!(angle_from_counts(joint(7), 1023, 0), MicroDegrees(84_384_000));
    }

    #[test]
    fn no_angle_and_no_offset_overflows() {
        for joint in Joint::ALL {
            for (angle, offset) in
                [(i32::MIN, i8::MAX), (i32::MIN, i8::MIN), (i32::MAX, i8::MAX), (i32::MAX, i8::MIN)]
            {
                assert!([0, 1023].contains(&counts_from_angle(joint, MicroDegrees(angle), offset)));
            }
        }
    }

    #[test]
    fn fractions_of_degrees_become_the_nearest_angle() {
        assert_eq!(MicroDegrees::nearest(88.229), MicroDegrees(88_229_000));
        assert_eq!(MicroDegrees::nearest(0.000_000_6), MicroDegrees(1));
        assert_eq!(MicroDegrees::nearest(-0.000_000_6), MicroDegrees(-1));
        assert_eq!(MicroDegrees::nearest(f32::MAX), MicroDegrees(i32::MAX));
    }

    #[test]
    fn d27_a_push_is_the_load_less_what_the_speed_needs() {
        let push = |number, load, speed| push_from_servo(joint(number), load, speed);
        assert_eq!([push(1, 700, 0), push(2, 700, 0), push(7, -400, 0)], [700, -700, -400]);
        assert_eq!([push(1, 1_000, 1_757), push(1, -1_000, -1_757)], [0, 0], "free at full speed");
        assert_eq!([push(5, 1_000, 1_292), push(1, 1_000, -1_757)], [0, 2_000], "driven backwards");
        assert_eq!(push(1, i16::MAX, i16::MIN), 0, "no servo answers this");
    }

    #[test]
    fn m09_a_load_is_positive_towards_greater_angles() {
        let loads = [1, 2, 3, 4, 5, 6, 7].map(|number| load_from_servo(joint(number), 284));
        assert_eq!(loads, [284, -284, -284, -284, -284, -284, 284]);
    }

    #[test]
    fn a_register_shows_the_nearest_degree_from_0_to_180() {
        let shown = |micro| MicroDegrees(micro).nearest_degree();
        assert_eq!([shown(89_499_999), shown(89_500_000), shown(90_499_999)], [89, 90, 90]);
        assert_eq!([shown(-1), shown(i32::MIN), shown(180_600_000), shown(i32::MAX)], [0, 0, 180, 180]);
    }
}
