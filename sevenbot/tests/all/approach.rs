//! The way to the first point of a stream or a recording, on an arm in virtual time.

use std::time::Duration;

use sevenbot::approach::{Approach, ApproachRule};
use sevenbot::map::{SET_POINT_PERIOD, SPEED, TARGET_POSITION};
use sevenbot::moves::{MoveError, Observer, Player};
use sevenbot::recording::Recording;
use sevenbot::simulated::{self, SharedSimulation, SimulationConfig};
use sevenbot::stream::{SetPointStream, StreamOptions};
use sevenbot::{Arm, FineAngle, Joint};

const REST: [f64; 7] = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0];

/// An arm at rest in its standard pose.
fn arm() -> (Arm, SharedSimulation) {
    let (mut arm, simulation) = simulated::arm(SimulationConfig::default()).unwrap();
    arm.sleep(Duration::from_secs(1));
    (arm, simulation)
}

/// Records the true angle of joint 1 at each call: the time in microseconds, and the angle in thousandths of a degree.
struct Witness {
    simulation: SharedSimulation,
    seen: Vec<(u64, i32)>,
}

impl Observer for Witness {
    fn goes_on(&mut self) -> bool {
        let now = self
            .simulation
            .with(|simulation| (simulation.now().as_micros(), simulation.plant().angle(Joint::ALL[0])));
        self.seen.push(now);
        true
    }
}

impl Witness {
    /// The largest speed of joint 1 over 40 ms or more, in degrees/s.
    fn fastest(&self) -> f64 {
        let mut fastest: f64 = 0.0;
        for (index, (start, from)) in self.seen.iter().enumerate() {
            let later = self.seen.iter().skip(index).find(|(time, _)| time - start >= 40_000);
            if let Some((end, to)) = later {
                let seconds = f64::from(u32::try_from(end - start).unwrap()) / 1e6;
                fastest = fastest.max(f64::from((to - from).abs()) / 1e3 / seconds);
            }
        }
        fastest
    }
}

fn first_of_joint_1(degrees: f64) -> [Option<FineAngle>; 7] {
    let mut first = [None; 7];
    first[0] = FineAngle::from_degrees(degrees);
    first
}

#[test]
fn a_speed_of_zero_that_was_left_behind_makes_no_jump() {
    for (degrees, rule, most) in
        [(94.5, ApproachRule::Near, 45.0), (150.0, ApproachRule::Within(Duration::from_secs(2)), 60.0)]
    {
        let (mut arm, simulation) = arm();
        arm.write_checked(SPEED.address, &[0; 7]).unwrap();
        let way = Approach::plan(&arm.standing().unwrap(), &first_of_joint_1(degrees), rule).unwrap();
        let mut stream = SetPointStream::open(&mut arm, StreamOptions::new(20).unwrap()).unwrap();
        let mut witness = Witness { simulation: simulation.clone(), seen: Vec::new() };
        stream.approach(&way, &mut witness).unwrap();
        stream.close().unwrap();
        let fastest = witness.fastest();
        assert!(fastest < most && fastest > 10.0, "{degrees}: {fastest} degrees/s");
        arm.sleep(Duration::from_secs(1));
        let there = simulation.with(|simulation| simulation.plant().angle(Joint::ALL[0]));
        assert!((f64::from(there) / 1e3 - degrees).abs() < 1.5, "{there}");
    }
}

fn recording(angles: &[f64]) -> Recording {
    let [_, rest @ ..] = REST;
    let rest = rest.map(|angle| angle.to_string()).join(" ");
    let lines = (0..).zip(angles).map(|(time, angle): (u32, _)| format!("{time} {angle} {rest} 0\n"));
    Recording::parse(&format!("7bot-recording 2\n{}", lines.collect::<String>())).unwrap()
}

#[test]
fn a_recording_that_begins_far_away_is_refused_and_nothing_moves() {
    let (mut arm, _) = arm();
    let before = arm.read(SPEED.address, 21).unwrap();
    let refused = Player::new(&recording(&[120.0, 130.0]), 1.0).play(&mut arm, 1, &mut ()).unwrap_err();
    let MoveError::StartTooFar(far) = &refused else { panic!("{refused}") };
    assert_eq!((far.joints.len(), far.is_seam), (1, false));
    assert!(refused.to_string().contains("° from 120.00°"), "{refused}");
    assert_eq!(arm.read(SPEED.address, 21).unwrap(), before, "no speed and no target was written");
}

#[test]
fn an_approach_leads_to_a_recording_without_a_jump() {
    let (mut arm, simulation) = arm();
    let rule = ApproachRule::Within(Duration::from_secs(2));
    let mut witness = Witness { simulation, seen: Vec::new() };
    let start = arm.now();
    let mut player = Player::new(&recording(&[130.0, 130.0]), 1.0).with_approach(rule);
    player.play(&mut arm, 1, &mut witness).unwrap();
    assert!(arm.now() - start > Duration::from_secs(3));
    // 40 degrees in 2 s: 30 degrees/s at most.
    let fastest = witness.fastest();
    assert!(fastest > 20.0 && fastest < 40.0, "{fastest} degrees/s");
    assert_eq!(arm.read(SET_POINT_PERIOD.address, 3).unwrap(), [0; 3], "the stream has ended");
}

#[test]
fn the_way_back_of_a_loop_needs_an_approach_too() {
    let (mut arm, _) = arm();
    let there = recording(&[90.0, 110.0]);
    let refused = Player::new(&there, 1.0).play(&mut arm, 2, &mut ()).unwrap_err();
    let MoveError::StartTooFar(far) = &refused else { panic!("{refused}") };
    assert_eq!((far.is_seam, far.joints.as_slice()), (true, &[(Joint::ALL[0], 110.0, 90.0)][..]));
    assert_eq!(arm.read(TARGET_POSITION.address, 1).unwrap(), [90], "before anything moved");
    let rule = ApproachRule::Within(Duration::from_secs(1));
    let mut player = Player::new(&there, 1.0).with_approach(rule);
    player.play(&mut arm, 2, &mut ()).unwrap();
    assert_eq!(player.played(), 2);
    let mut back = Player::new(&recording(&[90.0, 110.0, 92.0]), 1.0).with_approach(rule);
    back.play(&mut arm, 1, &mut ()).unwrap();
    let closed = Player::new(&recording(&[90.0, 110.0, 92.0]), 1.0).play(&mut arm, 2, &mut ());
    assert_eq!(closed, Ok(()), "a seam of two degrees is no jump");
}
