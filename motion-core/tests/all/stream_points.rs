//! Streams of points whose frames come early, late, too fast, or not at all (D23).

#![allow(clippy::cast_precision_loss)] // The numbers are far below 2^53, so `f64` holds them exactly.

use motion_core::CYCLE;
use motion_core::calibration::MicroDegrees;
use motion_core::trajectory::Trajectory;
use proptest::prelude::*;
use protocol_core::time::{Duration, Instant};

const CYCLE_US: u64 = CYCLE.as_micros();
/// The speed register for 372 degrees/s.
const FASTEST: u8 = 0;

/// A point of a stream: when its frame comes, in microseconds, and its angle in micro-degrees.
type Arrival = (u64, i32);

/// The set-point at the end of each control cycle, from time zero on, of a joint at rest at `start`.
fn set_points(start: i32, arrivals: &[Arrival], period_us: u64, speed: u8, phase_us: u64) -> Vec<(u64, i32)> {
    let mut trajectory = Trajectory::holding(MicroDegrees(start));
    let mut arrivals = arrivals.iter().peekable();
    let end = arrivals.clone().map(|(at, _)| *at).max().unwrap_or(0) + 3 * period_us + 2_000_000;
    let mut out = Vec::new();
    for cycle in (phase_us + CYCLE_US..end).step_by(CYCLE_US.try_into().unwrap()) {
        while let Some((at, angle)) = arrivals.next_if(|(at, _)| *at <= cycle) {
            let period = Duration::from_micros(period_us);
            trajectory.stream_to(MicroDegrees(*angle), Instant::from_micros(*at), period);
        }
        trajectory.advance(Instant::from_micros(cycle), speed);
        out.push((cycle, trajectory.set_point().0));
    }
    assert!(!trajectory.is_moving(), "it stops at the last point");
    out
}

/// A period in microseconds, the times of 60 frames, and the phase of the control cycles. Each frame is up to `jitter`
/// thousandths of the period earlier or later than its place on the grid.
fn jittered(jitter: i64) -> impl Strategy<Value = (u64, Vec<u64>, u64)> {
    let errors = prop::collection::vec(-jitter..=jitter, 60);
    (5_u64..=200, errors, 0..CYCLE_US).prop_map(|(millis, errors, phase)| {
        // A thousandth of a period is `millis` microseconds.
        let arrival =
            |(error, k): (i64, u64)| (millis * 1_000 * k).saturating_add_signed(millis.cast_signed() * error);
        (millis * 1_000, errors.into_iter().zip(200..).map(arrival).collect(), phase)
    })
}

/// Points of a motion at constant velocity: `step` micro-degrees per point.
fn ramp(times: &[u64], step: i32) -> Vec<Arrival> {
    times.iter().zip(1..).map(|(&at, k)| (at, k * step)).collect()
}

/// Micro-degrees per point at 100 degrees/s, or less where 60 points would go beyond 180 degrees.
fn step_for(period_us: u64) -> i32 {
    i32::try_from((100 * period_us).min(2_900_000)).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn d23_a_quarter_of_a_period_of_jitter_leaves_less_than_five_percent((period, times, phase) in jittered(250)) {
        let step = step_for(period);
        let arrivals = ramp(&times, step);
        let out = set_points(0, &arrivals, period, FASTEST, phase);
        let expected = f64::from(step) * CYCLE_US as f64 / period as f64;
        // Leave out the start from rest before the first points, and the stop at the last point.
        let (first, last) = (2 * step, arrivals.last().unwrap().1 - 2 * step);
        for pair in out.windows(2).filter(|pair| pair[0].1 >= first && pair[1].1 <= last) {
            let velocity = f64::from(pair[1].1 - pair[0].1) / expected;
            prop_assert!((velocity - 1.0).abs() < 0.05, "{velocity} at {}", pair[1].0);
        }
    }

    #[test]
    fn d23_each_point_is_reached_in_two_periods_and_a_cycle((period, times, phase) in jittered(500)) {
        let arrivals = ramp(&times, step_for(period));
        let out = set_points(0, &arrivals, period, FASTEST, phase);
        for (at, angle) in arrivals {
            let (reached, _) = out.iter().find(|(_, set_point)| *set_point >= angle).unwrap();
            prop_assert!(*reached <= at + 2 * period + CYCLE_US, "{angle} came at {at}, reached at {reached}");
        }
    }

    #[test]
    fn d23_no_joint_is_faster_than_its_speed_or_goes_past_the_points(
        gaps in prop::collection::vec(0_u64..300_000, 1..40),
        angles in prop::collection::vec(0..=180_000_000, 40),
        (start, millis, speed, phase) in (0..=180_000_000, 5_u64..=1_000, 0..=100_u8, 0..CYCLE_US),
    ) {
        let mut at = 500_000;
        let arrivals: Vec<Arrival> = gaps.iter().zip(&angles).map(|(gap, &angle)| { at += gap; (at, angle) }).collect();
        // A slower joint would not arrive within the time that `set_points` simulates.
        let speed = if speed == 0 { 0 } else { speed.max(50) };
        let out = set_points(start, &arrivals, millis * 1_000, speed, phase);
        let most = if speed == 0 { 3_720_000 } else { i32::from(speed) * 19_000 };
        let mut before = start;
        let points = arrivals.iter().map(|(_, angle)| *angle).chain([start]);
        let (low, high) = (points.clone().min().unwrap(), points.max().unwrap());
        for (_, set_point) in &out {
            prop_assert!((set_point - before).abs() <= most && (low..=high).contains(set_point));
            before = *set_point;
        }
        prop_assert_eq!(before, arrivals.last().unwrap().1);
    }
}

/// The time at which the set-point reaches its final value for good.
fn settled(out: &[(u64, i32)]) -> u64 {
    let (_, end) = *out.last().unwrap();
    out.iter().rev().take_while(|(_, set_point)| *set_point == end).last().unwrap().0
}

#[test]
fn d23_points_that_come_too_fast_are_not_piled_up() {
    // 100 points in 10 ms, and one frame every millisecond for a second.
    for (count, gap) in [(100, 100), (1_000, 1_000)] {
        let arrivals: Vec<Arrival> =
            (1..=count).map(|k| (1_000_000 + k * gap, i32::try_from(k).unwrap() * 10_000)).collect();
        let out = set_points(0, &arrivals, 20_000, FASTEST, 0);
        let (last, _) = *arrivals.last().unwrap();
        assert!(settled(&out) <= last + 40_000 + CYCLE_US, "{}", settled(&out) - last);
    }
}

#[test]
fn d23_a_shorter_period_counts_from_the_next_point_on() {
    let mut trajectory = Trajectory::holding(MicroDegrees(0));
    let at = |millis: u64| Instant::from_micros(millis * 1_000);
    for (millis, angle, period) in [(1_000, 10_000_000, 1_000), (1_010, 3_000_000, 20)] {
        trajectory.stream_to(MicroDegrees(angle), at(millis), Duration::from_millis(period));
    }
    for millis in (1_010..=1_050).step_by(10) {
        trajectory.advance(at(millis), FASTEST);
    }
    assert_eq!(trajectory.set_point(), MicroDegrees(3_000_000), "two short periods after its frame");
}

#[test]
fn d23_a_coarse_target_ends_the_stream_at_once() {
    let mut trajectory = Trajectory::holding(MicroDegrees(0));
    let at = |millis: u64| Instant::from_micros(millis * 1_000);
    trajectory.stream_to(MicroDegrees(10_000_000), at(1_000), Duration::from_millis(20));
    trajectory.move_to(MicroDegrees(0), 0);
    trajectory.advance(at(1_010), FASTEST);
    assert_eq!(trajectory.set_point(), MicroDegrees(0), "it does not go to the point first");
}

#[test]
fn d23_a_point_after_a_coarse_target_is_the_first_one_of_a_new_stream() {
    let at = |millis: u64| Instant::from_micros(millis * 1_000);
    let period = Duration::from_millis(200);
    // On the grid of the ended stream, the point would be due 225 or 366 ms after its frame.
    for frame in [1_280, 1_330] {
        let mut trajectory = Trajectory::holding(MicroDegrees(0));
        trajectory.stream_to(MicroDegrees(0), at(1_000), period);
        trajectory.move_to(MicroDegrees(0), 0);
        trajectory.stream_to(MicroDegrees(3_000_000), at(frame), period);
        for millis in (10..=300).step_by(10) {
            trajectory.advance(at(frame + millis), FASTEST);
            let wanted = i32::try_from(millis).unwrap() * 10_000;
            assert_eq!(trajectory.set_point(), MicroDegrees(wanted), "{millis} ms after {frame}");
        }
    }
}

#[test]
fn d23_one_lost_frame_does_not_move_the_grid() {
    let times: Vec<u64> = (0..40).map(|k| 1_000_000 + k * 20_000).collect();
    let all = ramp(&times, 2_000_000);
    let lost: Vec<Arrival> = all.iter().copied().filter(|(_, angle)| *angle != 40_000_000).collect();
    let (whole, with_gap) =
        (set_points(0, &all, 20_000, FASTEST, 3_000), set_points(0, &lost, 20_000, FASTEST, 3_000));
    let differing: Vec<u64> = whole.iter().zip(&with_gap).filter(|(a, b)| a != b).map(|(a, _)| a.0).collect();
    assert!(
        !differing.is_empty() && differing.last().unwrap() - differing.first().unwrap() < 40_000,
        "{differing:?}"
    );
}

#[test]
fn d23_a_joint_that_cannot_keep_up_passes_over_older_points() {
    let mut trajectory = Trajectory::holding(MicroDegrees(0));
    let at = |millis: u64| Instant::from_micros(millis * 1_000);
    trajectory.stream_to(MicroDegrees(100_000_000), at(1_000), Duration::from_millis(20));
    trajectory.advance(at(1_010), 10);
    assert_eq!(trajectory.set_point(), MicroDegrees(190_000));
    trajectory.stream_to(MicroDegrees(0), at(1_020), Duration::from_millis(20));
    trajectory.advance(at(1_020), 10);
    assert_eq!(trajectory.set_point(), MicroDegrees(0), "the first point is not due yet");
}

#[test]
fn d23_a_joint_that_cannot_keep_up_goes_towards_the_newest_point() {
    // The joint turns at 19 degrees/s. The points go away from it at 100 degrees/s, and then are back at its start.
    let times: Vec<u64> = (0..10).map(|k| 1_000_000 + k * 20_000).collect();
    let mut arrivals = ramp(&times, 2_000_000);
    arrivals.extend((10..20).map(|k| (1_000_000 + k * 20_000, 0)));
    let out = set_points(0, &arrivals, 20_000, 10, 0);
    let highest = out.iter().map(|(_, set_point)| *set_point).max().unwrap();
    assert_eq!(highest % 190_000, 0, "always at its speed");
    assert!((3_000_000..=4_500_000).contains(&highest), "{highest}: it turns back as soon as the points do");
}

#[test]
fn d23_a_host_whose_clock_is_wrong_by_a_thousandth_is_followed() {
    for gap in [19_980, 20_020] {
        let times: Vec<u64> = (0..3_000).map(|k| 1_000_000 + k * gap).collect();
        let out = set_points(0, &ramp(&times, 50_000), 20_000, FASTEST, 0);
        let steps: Vec<i32> = out.windows(2).map(|pair| pair[1].1 - pair[0].1).collect();
        let moving: Vec<i32> = steps.into_iter().filter(|&step| step != 0).skip(20).collect();
        let (low, high) = (moving[..5_000].iter().min().unwrap(), moving[..5_000].iter().max().unwrap());
        assert!(*low > 23_750 && *high < 26_250, "{low} to {high} instead of 25000");
    }
}
