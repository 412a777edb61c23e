//! Streams at their limits: the latest frames that continue a stream or follow no lost frame, a joint that is just fast
//! enough, and a joint that is too slow (D23).

use motion_core::calibration::MicroDegrees;
use motion_core::point_stream::PointStream;
use motion_core::trajectory::Trajectory;
use protocol_core::time::{Duration, Instant};

const PERIOD: Duration = Duration::from_millis(100);

fn at_us(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

fn degrees(degrees: i32) -> MicroDegrees {
    MicroDegrees(degrees * 1_000_000)
}

/// True if the point whose frame comes at `frame_us` is due at `due_us`. The point before it is due at 1.15 s.
fn is_due_at(due_us: u64, frame_us: u64) -> bool {
    let mut stream = PointStream::NONE;
    stream.push(at_us(1_000_000), PERIOD, degrees(0));
    stream.push(at_us(frame_us), PERIOD, degrees(10));
    let reaches = |end| stream.clone().follow(degrees(0), at_us(end)) == degrees(10);
    reaches(due_us) && !reaches(due_us - 1)
}

#[test]
fn d23_a_frame_up_to_a_period_after_the_last_point_belongs_to_the_stream() {
    // The point keeps to the grid: 1.35 s, shifted by a sixteenth of the 50 ms to 1.4 s.
    assert!(is_due_at(1_353_125, 1_250_000));
    // A new stream: one and a half periods after its frame.
    assert!(is_due_at(1_400_001, 1_250_001));
}

#[test]
fn d23_a_frame_later_than_an_eighth_of_a_period_follows_a_lost_one() {
    // The next place of the grid is 1.25 s.
    assert!(is_due_at(1_253_906, 1_162_500));
    // One place of the grid is left out for the lost frame.
    assert!(is_due_at(1_347_657, 1_162_501));
}

/// The set-points at the ends of control cycles. `ends` are in microseconds.
fn set_points(trajectory: &mut Trajectory, ends: impl Iterator<Item = u64>, speed: u8) -> Vec<MicroDegrees> {
    ends.map(|end| {
        trajectory.advance(at_us(end), speed);
        trajectory.set_point()
    })
    .collect()
}

#[test]
fn d23_a_joint_that_is_just_fast_enough_goes_through_every_point() {
    let mut trajectory = Trajectory::holding(degrees(0));
    // 28.5 degrees in 150 ms are 190 degrees/s: speed 100.
    trajectory.stream_to(MicroDegrees(28_500_000), at_us(1_000_000), PERIOD);
    set_points(&mut trajectory, (1_010_000..=1_100_000).step_by(10_000), 100);
    trajectory.stream_to(degrees(20), at_us(1_100_000), PERIOD);
    let turn = set_points(&mut trajectory, (1_110_000..=1_150_000).step_by(10_000), 100);
    assert_eq!(turn.last(), Some(&MicroDegrees(28_500_000)));
}

#[test]
fn d23_a_joint_that_is_too_slow_passes_over_all_points_but_the_newest() {
    let period = Duration::from_millis(50);
    let mut trajectory = Trajectory::holding(degrees(90));
    for (frame_us, angle) in [(1_000_000, 130), (1_030_000, 130), (1_060_000, 85)] {
        trajectory.stream_to(degrees(angle), at_us(frame_us), period);
    }
    // The newest point is due 100 ms after its frame. The others are out of reach at 114 degrees/s.
    let way = set_points(&mut trajectory, (1_070_000..=1_160_000).step_by(10_000), 60);
    assert!(
        way.is_sorted_by(|before, after| before.0 > after.0),
        "it goes straight to the newest point: {way:?}"
    );
    assert_eq!(way.last(), Some(&degrees(85)));
}
