use super::*;
use crate::approach::{ApproachRule, Standing};
use crate::playback;
use crate::recording::Recording;
use crate::units::Speed;

const PERIOD: Duration = ms(20);

const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// Joint 1 goes from 90 to 100 degrees within a second; the pump sucks from 50 ms on.
fn recording() -> Recording {
    let text = "7bot-recording 2\n0 90 90 65 90 90 90 80 0\n0.05 90.5 90 65 90 90 90 80 1\n1 100 90 65 90 90 90 80 1\n";
    Recording::parse(text).expect("a recording")
}

fn run() -> MovementRun {
    MovementRun::along(PointPath::new(&recording(), 1.0), Some(false), ms(5_000), PERIOD)
}

/// All steps that are due at `now`, and the wait or the end after them.
fn steps(run: &mut MovementRun, now: Duration) -> Vec<RunStep> {
    let all = std::iter::from_fn(|| Some(run.poll(now)));
    let is_end = |step: &RunStep| matches!(step, RunStep::Wait(_) | RunStep::Over | RunStep::Paused(_));
    let mut ended = false;
    all.take_while(|step| !std::mem::replace(&mut ended, is_end(step))).collect()
}

/// Joint 1 in hundredths of a degree.
fn base(step: &RunStep) -> u16 {
    let RunStep::Point([Some(base), ..]) = step else { panic!("no point: {step:?}") };
    base.hundredths()
}

#[test]
fn a_path_sends_a_point_each_period_and_switches_the_pump_before_its_point() {
    let mut run = run();
    let first = steps(&mut run, ms(5_000));
    assert_eq!((base(&first[0]), &first[1]), (9_000, &RunStep::Wait(ms(5_020))));
    assert_eq!(steps(&mut run, ms(5_010)), [RunStep::Wait(ms(5_020))], "not due yet");
    for time in [5_020, 5_040] {
        assert_eq!(steps(&mut run, ms(time)).len(), 2);
    }
    let third = steps(&mut run, ms(5_060));
    assert_eq!((&third[0], base(&third[1])), (&RunStep::Vacuum(true), 9_060));
    assert_eq!(third[0].frames(), [(VACUUM_PUMP.address, vec![1])]);
    let (mut now, mut points) = (ms(5_080), 4);
    let end = loop {
        match run.poll(now) {
            RunStep::Wait(until) => now = until,
            RunStep::Over => break now,
            step => {
                base(&step);
                points += 1;
            }
        }
    };
    assert_eq!((points, end), (51, ms(6_000) + 2 * PERIOD + TAIL));
    assert_eq!((run.progress(), run.counts().late), ((50, 50), 0));
}

#[test]
fn a_late_program_passes_points_over_and_counts_them() {
    let mut run = run();
    steps(&mut run, ms(5_000));
    let late = steps(&mut run, ms(5_190));
    assert_eq!((&late[0], base(&late[1])), (&RunStep::Vacuum(true), 9_180));
    assert_eq!(run.counts().late, 9, "eight passed over, and this one");
}

#[test]
fn after_a_pause_the_movement_goes_on_where_the_arm_stopped() {
    let mut run = run();
    for time in (5_000..=5_100).step_by(20) {
        steps(&mut run, ms(time));
    }
    let after = steps(&mut run, ms(5_900));
    assert_eq!(base(&after[0]), 9_120, "the next point, not that of 900 ms");
    let next = steps(&mut run, ms(5_920));
    assert!((9_120..9_160).contains(&base(&next[0])), "{next:?}");
    assert_eq!(steps(&mut run, ms(8_000)), [RunStep::Paused(ms(2_060))], "a person may rely on the stop");
}

#[test]
fn a_way_ends_at_its_point() {
    let here = [90.0; 7];
    let standing = Standing { measured: here.map(Some), targets: here, speeds: [Speed::MAXIMUM; 7] };
    let first = [crate::FineAngle::from_degrees(93.0); 7];
    let way = Approach::plan(&standing, &first, ApproachRule::Near).expect("near");
    let mut run = MovementRun::approach(way, ms(0), PERIOD);
    let (mut now, mut last) = (ms(0), RunStep::Over);
    loop {
        match run.poll(now) {
            RunStep::Wait(until) => now = until,
            RunStep::Over => break,
            step => last = step,
        }
    }
    assert_eq!((last, now), (RunStep::Point(first), ms(180)), "150 ms at up to 30 degrees/s, and a period");
}

#[test]
fn steps_keep_their_times_and_are_not_passed_over() {
    let all = playback::steps(&recording(), 1.0);
    let mut run = MovementRun::in_steps(all.clone(), ms(1_000));
    assert_eq!(steps(&mut run, ms(1_000)).len(), 2);
    let second = steps(&mut run, ms(1_000) + all[2].time);
    assert_eq!(second.len(), 3, "two were due: {second:?}");
    let after = steps(&mut run, ms(1_700));
    assert_eq!(after.len(), 2, "one, and the others later: {after:?}");
    assert_eq!(steps(&mut run, ms(9_000)).len(), 1, "paused for too long");
}

#[test]
fn nothing_to_send_is_over_at_once() {
    assert_eq!(MovementRun::in_steps(Vec::new(), ms(7)).poll(ms(7)), RunStep::Over);
}
