//! Arms that step together: the number of threads changes nothing, and each arm does what an arm alone does with the same
//! frames. Also wrong calls, resets, and lost replies.

use arm_sim::request::Request;
use protocol_core::registers::map::{FINE_POSITION, FINE_TARGET, SET_POINT_PERIOD};

use super::*;

const STEP: Duration = Duration::from_millis(20);
const REST: [f64; JOINTS] = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0];

fn arms(count: u64, threads: usize) -> SimulatedArms {
    let seeds: Vec<u64> = (1..=count).collect();
    SimulatedArms::new(&seeds, NonZeroUsize::new(threads).expect("threads"))
}

/// Targets near [`REST`]. They depend only on the numbers of the arm and of the step.
fn targets(arm: usize, step: usize) -> [f64; JOINTS] {
    let turn = |joint: usize| f64::from(u8::try_from((arm * 7 + step * 3 + joint * 5) % 11).expect("small"));
    std::array::from_fn(|joint| REST[joint] + turn(joint) - 6.0)
}

fn disturb(arms: &mut SimulatedArms) {
    arms.each(None, |index, arm| {
        arm.plant_mut().set_load(u16::try_from(index % 5 * 60).expect("grams"));
        let fault = ["line=corruption=1%", "2=wall=88", "3=late=20", "line=loss=1%", "supply=dips=300"];
        if index % 7 < fault.len() {
            arm.set_fault(fault[index % 7].parse().expect("a fault"), None);
        }
    });
}

/// The bits of all observations of 40 steps, so that NaN is equal to itself.
fn run(threads: usize) -> Vec<u64> {
    let mut arms = arms(100, threads);
    disturb(&mut arms);
    let (mut all, mut seen) = (Vec::new(), vec![0.0; 100 * WIDTH]);
    for step in 0..40 {
        let targets: Vec<f64> = (0..100).flat_map(|arm| targets(arm, step)).collect();
        arms.step(Some(&targets), STEP, &mut seen).expect("a step");
        all.extend(seen.iter().map(|number: &f64| number.to_bits()));
    }
    all
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let alone = run(1);
    assert!(alone == run(2) && alone == run(3));
}

#[test]
fn an_arm_among_many_is_the_simulation_alone() {
    let mut many = arms(40, 2);
    disturb(&mut many);
    let mut alone = many.arm(23).expect("an arm").clone();
    let mut seen = vec![0.0_f64; 40 * WIDTH];
    for step in 0..50 {
        let all: Vec<f64> = (0..40).flat_map(|arm| targets(arm, step)).collect();
        many.step(Some(&all), STEP, &mut seen).expect("a step");
        if step == 0 {
            alone.send_request(&Request::Write { address: SET_POINT_PERIOD.address, values: &[20, 0] });
        }
        let hundredths = targets(23, step).map(|degrees| fine_bytes(degrees * 100.0));
        alone.send_request(&Request::Write {
            address: FINE_TARGET.address,
            values: hundredths.as_flattened(),
        });
        alone.advance(time::Duration::from_millis(20));
        alone.send_request(&Request::Read { address: FINE_POSITION.address, count: 54 });
        let reply = alone.take_received();
        let position = f64::from(u16::from_le_bytes([reply[5], reply[6]])) / 100.0;
        assert_eq!(seen[23 * WIDTH], position, "step {step}");
    }
    let everything = |arm: &Simulation| {
        let mut arm = arm.clone();
        arm.send_request(&Request::Read { address: 0, count: 255 });
        let joints = arm_sim::Joint::ALL.map(|joint| (arm.plant().angle(joint), arm.plant().load(joint)));
        (arm.take_received(), joints, arm.now())
    };
    assert_eq!(everything(many.arm(23).expect("an arm")), everything(&alone));
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 18000")]
fn fine_bytes(hundredths: f64) -> [u8; 2] {
    (hundredths as u16).to_le_bytes()
}

#[test]
fn a_wrong_call_lets_no_time_pass() {
    let mut arms = arms(2, 2);
    let (before, mut seen) = (arms.arm(0).expect("an arm").now(), [0.0_f64; 2 * WIDTH]);
    let mut targets = [REST, REST];
    targets[1][2] = f64::NAN;
    let error = arms.step(Some(targets.as_flattened()), STEP, &mut seen).expect_err("no number");
    assert_eq!(error.to_string(), "arm 1, joint 3: NaN is out of range: use 0 to 180 degrees");
    let none: Option<&[f64]> = None;
    let short = arms.step(none, STEP, &mut seen[1..]);
    assert_eq!(short, Err(StepError::Length { given: 2 * WIDTH - 1, wanted: 2 * WIDTH }));
    for micros in [0, 4_000, 20_500, 1_001_000] {
        let time = Duration::from_micros(micros);
        assert_eq!(arms.step(none, time, &mut seen), Err(StepError::Time(time)));
    }
    assert_eq!(arms.arm(0).expect("an arm").now(), before);
}

#[test]
fn a_reset_concerns_the_arms_of_its_mask() {
    let mut arms = arms(2, 1);
    let mut seen = [[0.0_f64; WIDTH]; 2];
    let targets = [[100.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]; 2];
    for _ in 0..50 {
        arms.step(Some(targets.as_flattened()), STEP, seen.as_flattened_mut()).expect("a step");
    }
    assert!(seen.iter().all(|row| (row[0] - 100.0).abs() < 1.0 && row[BLOCKED] == [0.0; 7]), "{seen:?}");
    arms.reset(Some(&[false, true]), None);
    arms.observe(seen.as_flattened_mut()).expect("the length");
    assert!((seen[0][0] - 100.0).abs() < 1.0 && (seen[1][0] - 90.0).abs() < 0.5, "{seen:?}");
    let first = arms.arm(0).expect("an arm").clone();
    arms.reset(None, Some(&first));
    arms.observe(seen.as_flattened_mut()).expect("the length");
    assert_eq!(seen[0], seen[1]);
}

#[test]
fn a_lost_reply_leaves_the_last_observation_and_tells_its_age() {
    let mut arms = arms(1, 1);
    let mut seen = [0.0_f64; WIDTH];
    arms.step(Some(&REST), STEP, &mut seen).expect("a step");
    assert_eq!(seen[AGE], [0.0]);
    let before = seen;
    arms.each(None, |_, arm| {
        arm.set_fault("line=loss=100%".parse().expect("a fault"), None);
    });
    for _ in 0..3 {
        arms.step(Some(&[120.0; 7]), STEP, &mut seen).expect("a step");
    }
    assert_eq!(seen[AGE], [0.06]);
    assert_eq!(seen[..31], before[..31]);
}

#[test]
fn arms_whose_joints_are_moved_outside_do_not_depend_on_the_threads() {
    let run = |threads| {
        let mut arms = arms(40, threads);
        let (mut measured, mut wanted) = (vec![0.0; 40 * MEASURED], vec![0.0; 40 * WANTED]);
        for row in measured.chunks_mut(MEASURED) {
            row[..JOINTS].copy_from_slice(&REST);
            row[6] = f64::NAN;
        }
        // The targets stay the same from step 19 on, so that the joint of this simulation settles.
        for step in 0..40 {
            let all: Vec<f64> = (0..40).flat_map(|arm| targets(arm, step.min(19))).collect();
            arms.send(&all, STEP).expect("targets");
            for _ in 0..10 {
                arms.exchange(&measured, Duration::from_millis(2), &mut wanted).expect("an exchange");
                for (measured, wanted) in measured.chunks_mut(MEASURED).zip(wanted.chunks(WANTED)) {
                    measured[..6].copy_from_slice(&wanted[..6]);
                    measured[7..14].copy_from_slice(&wanted[SET_VELOCITIES]);
                }
            }
        }
        let mut seen = vec![0.0_f64; 40 * WIDTH];
        arms.read(&mut seen).expect("the length");
        let last = targets(7, 19);
        let row = &seen[7 * WIDTH..];
        assert!((row[0] - last[0]).abs() < 1.0, "outside: {} is not {}", row[0], last[0]);
        assert!((row[6] - last[6]).abs() < 1.5, "joint 7 is inside: {} is not {}", row[6], last[6]);
        (wanted, seen)
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_wrong_measurement_lets_no_time_pass() {
    let mut arms = arms(2, 1);
    let before = arms.arm(0).expect("an arm").now();
    let (mut measured, mut wanted) = ([90.0; 2 * MEASURED], [0.0_f64; 2 * WANTED]);
    measured[MEASURED + 9] = f64::NAN;
    let error = arms.exchange(&measured, Duration::from_millis(2), &mut wanted).expect_err("no number");
    let text = error.to_string();
    let says = "arm 1, joint 3: a measurement of NaN is out of range: use -100000 to 100000, or NaN";
    assert!(text.starts_with(says), "{text}");
    measured[MEASURED + 2] = f64::NAN;
    let time = Duration::from_micros(1_500);
    assert_eq!(arms.exchange(&measured, time, &mut wanted), Err(StepError::ExchangeTime(time)));
    let length = StepError::Length { given: 1, wanted: 2 * MEASURED };
    assert_eq!(arms.exchange(&measured[..1], STEP, &mut wanted), Err(length));
    assert_eq!(arms.arm(0).expect("an arm").now(), before);
    assert_eq!(arms.exchange(&measured, STEP, &mut wanted), Ok(()));
}
