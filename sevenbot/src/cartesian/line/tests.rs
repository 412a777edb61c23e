use super::super::{DOWN, TipTarget, angle_between};
use super::*;
use crate::playback::MAX_SEGMENT;
use crate::units::Angle;

const STANDARD: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];
/// The angles of the maker's example of IK6; the tool points down.
const AT_WORK: [u8; 7] = [105, 88, 110, 90, 135, 30, 40];

fn request(start: [u8; 7], [x, y, z]: [f64; 3], tool: Vector, speed: f64) -> StraightLineRequest {
    let start = start.map(|degrees| Angle::from_register(degrees).into());
    let resolution = TargetResolution::Degrees;
    StraightLineRequest {
        start,
        resolution,
        vacuum: true,
        tip: Vector::new(x, y, z),
        tool,
        speed,
        guard: None,
    }
}

fn plan(start: [u8; 7], tip: [f64; 3], tool: Vector, speed: f64) -> Result<StraightLine, StraightLineError> {
    StraightLine::plan(&request(start, tip, tool, speed))
}

#[test]
fn a_line_over_the_table_stays_on_it_but_for_whole_degrees() {
    let line = plan(AT_WORK, [60.0, 200.0, 50.0], DOWN, 50.0).expect("a line");
    assert!((line.length_mm - 111.0).abs() < 3.0, "{}", line.length_mm);
    assert!((line.duration.as_secs_f64() - line.length_mm / 50.0).abs() < 1e-6);
    assert!(line.deviation_mm > 0.1 && line.deviation_mm < 3.5, "{}", line.deviation_mm);
    assert!(line.tilt_degrees < 2.5, "{}", line.tilt_degrees);
    assert_eq!(line.first_turn, None);
    // The reported deviation is the largest one of the targets.
    let end = Vector::new(60.0, 200.0, 50.0);
    let way = (end - line.start.tip).unit().expect("a way");
    let mut worst: f64 = 0.0;
    let mut along = f64::NEG_INFINITY;
    for pose in line.targets() {
        let from_start = TipPose::of_fine(pose).tip - line.start.tip;
        worst = worst.max((from_start - way * from_start.dot(way)).length());
        assert!(from_start.dot(way) > along - 4.0, "forward but for rounding");
        along = from_start.dot(way);
        assert_eq!([pose[5].degrees(), pose[6].degrees()], [30.0, 40.0]);
    }
    assert!((worst - line.deviation_mm).abs() < 0.5, "{worst}");
    let last = line.recording.moments().last().expect("an end");
    assert!((TipPose::of_fine(last.pose).tip - end).length() < 1.5 && last.vacuum);
    let times: Vec<_> = line.recording.moments().map(|moment| moment.time).collect();
    assert!(times.windows(2).all(|pair| pair[1] > pair[0] && pair[1] - pair[0] <= MAX_SEGMENT));
}

#[test]
fn the_tool_turns_on_the_way_and_makes_the_line_slower() {
    let line = plan(STANDARD, [0.0, 200.0, 150.0], DOWN, 500.0).expect("a line");
    assert_eq!(line.duration, Duration::from_millis(1500), "90 degrees");
    let middle = line.targets().nth(15).expect("a target");
    assert!(
        angle_between(TipPose::of_fine(middle).tool, Vector::new(0.0, 1.0, -1.0).unit().expect("one")) < 2.5
    );
}

#[test]
fn joint_4_turns_first_where_it_moves_nothing() {
    // At the start the hand is in line with the forearm. The tip moves to the side and the tool stays forward, so the hand bends.
    let line = plan(STANDARD, [40.0, 250.0, 219.0], Vector::new(0.0, 1.0, 0.0), 30.0).expect("a line");
    let first = line.first_turn.expect("a turn of joint 4").degrees();
    assert!(!(20.0..=160.0).contains(&first), "{first}");
    let start = line.targets().next().expect("a start");
    assert_eq!(TipPose::of_fine(start).tip, line.start.tip, "the tip stays");
}

#[test]
fn a_line_that_leaves_the_reach_says_where() {
    let error = plan(AT_WORK, [-50.0, 480.0, 50.0], DOWN, 50.0).expect_err("too far");
    assert!(matches!(error.fault, StraightLineFault::Unreachable(_)) && error.at_mm > 50.0, "{error}");
    let words = error.to_string();
    assert!(words.starts_with("the straight line breaks ") && words.contains("nearest point"), "{words}");
}

#[test]
fn both_ends_within_reach_are_not_enough() {
    // The line passes over the base, nearer to the shoulder than the linkage allows.
    let start = TipTarget::of(Vector::new(200.0, 60.0, 60.0), DOWN).expect("within reach").degrees;
    let [t1, t2, t3, t4, t5] = start;
    let end = [-200.0, 60.0, 60.0];
    assert!(TipTarget::of(Vector::new(-200.0, 60.0, 60.0), DOWN).is_ok());
    let error = plan([t1, t2, t3, t4, t5, 90, 80], end, DOWN, 50.0).expect_err("through the base");
    assert!(matches!(error.fault, StraightLineFault::Unreachable(_)), "{error}");
}

#[test]
fn a_joint_that_cannot_follow_says_which_speed_it_could() {
    let error = plan(AT_WORK, [60.0, 130.0, 60.0], DOWN, 2_000.0).expect_err("too fast");
    let StraightLineFault::TooFast { slower_mm_per_second, .. } = error.fault else { panic!("{error}") };
    assert!(
        error.to_string().contains(&format!("it could follow at {slower_mm_per_second} mm/s")),
        "{error}"
    );
    assert!(plan(AT_WORK, [60.0, 130.0, 60.0], DOWN, slower_mm_per_second * 0.98).is_ok());
    assert!(plan(AT_WORK, [60.0, 130.0, 60.0], DOWN, slower_mm_per_second * 1.1).is_err());
}

#[test]
fn a_singular_position_on_the_way_is_told() {
    // The tip passes beside the axis of the base, high above it: joint 1 would have to jump by half a turn.
    let [from, to] =
        [0, 180].map(|base| TipPose::of([base, 150, 30, 90, 90, 90, 80].map(Angle::from_register)));
    let end = [to.tip.x, 0.5, to.tip.z];
    let error = plan([0, 150, 30, 90, 90, 90, 80], end, from.tool, 50.0).expect_err("over the axis");
    assert!(error.to_string().contains("singular"), "{error}");
}

#[test]
fn a_line_of_no_length_is_a_line() {
    let tip = TipPose::of(AT_WORK.map(Angle::from_register));
    let line = plan(AT_WORK, [tip.tip.x, tip.tip.y, tip.tip.z], tip.tool, 50.0).expect("a line");
    assert_eq!((line.recording.moments().count(), line.duration), (2, MAX_SEGMENT));
    assert!(line.deviation_mm < 1e-9);
}

#[test]
fn numbers_that_are_no_position_are_told() {
    assert!(plan(AT_WORK, [0.0, 200.0, 50.0], Vector::new(0.0, 0.0, 0.0), 50.0).is_err());
    assert!(plan(AT_WORK, [0.0, f64::INFINITY, 50.0], DOWN, 50.0).is_err());
}

#[test]
fn in_hundredths_a_line_stays_within_a_tenth_of_a_millimetre() {
    let coarse = request(AT_WORK, [60.0, 200.0, 50.0], DOWN, 50.0);
    let fine = StraightLineRequest { resolution: TargetResolution::Hundredths, ..coarse };
    let line = StraightLine::plan(&fine).expect("a line");
    assert!(
        line.deviation_mm < 0.1 && line.tilt_degrees < 0.05,
        "{} {}",
        line.deviation_mm,
        line.tilt_degrees
    );
    let end = line.targets().last().expect("an end");
    assert!((TipPose::of_fine(end).tip - coarse.tip).length() < 0.1);
    let times: Vec<_> = line.recording.moments().map(|moment| moment.time).collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] <= Duration::from_millis(20)));
    // Between two targets the joints move in straight lines.
    let poses: Vec<_> = line.targets().collect();
    let way = (coarse.tip - line.start.tip).unit().expect("a way");
    for pair in poses.windows(2) {
        let middle = std::array::from_fn(|joint| pair[0][joint].between(pair[1][joint], 0.5));
        let from_start = TipPose::of_fine(middle).tip - line.start.tip;
        assert!((from_start - way * from_start.dot(way)).length() < 0.1);
    }
}
