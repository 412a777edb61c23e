//! Stops of an arm that is made of plain registers. Frames and replies may be lost.

use super::*;
use host_link::Snapshot;
use protocol_core::registers::map::{
    EXTENDED_VERSION, FINE_POSITION, FINE_TARGET, FRAMES_ACCEPTED, MOTOR_STATE, STATUS_VERSION, motor_state,
};

const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// The registers of an arm whose joint 1 goes from 50 to 150 degrees at its speed, unless it gets another target.
struct PlainArm(Snapshot);

impl PlainArm {
    fn new() -> Self {
        let mut arm = Self(Snapshot { address: 0, values: vec![0; 256] });
        for (row, value) in [(&STATUS_VERSION, 1), (&EXTENDED_VERSION, 1), (&MOTOR_STATE, motor_state::SERVO)]
        {
            arm.take(row.address, &[value]);
        }
        arm.take(SPEED.address, &[40, 41, 42, 43, 44, 45, 46]);
        arm.take(FRAMES_ACCEPTED.address, &[200]);
        for row in [FINE_TARGET, FINE_POSITION] {
            arm.take(row.address, &9_000_u16.to_le_bytes().repeat(7));
        }
        arm.take(FINE_TARGET.address, &15_000_u16.to_le_bytes());
        arm.take(FINE_POSITION.address, &5_000_u16.to_le_bytes());
        arm
    }

    fn take(&mut self, address: u8, values: &[u8]) {
        self.0.put(&Snapshot { address, values: values.to_vec() });
    }

    fn target(&self) -> u16 {
        self.0.word(FINE_TARGET.address)
    }

    fn position(&self) -> u16 {
        self.0.word(FINE_POSITION.address)
    }

    fn speeds(&self) -> [u8; 7] {
        self.0.joints(&SPEED)
    }

    /// Moves joint 1 for this time. One step of its speed is 1.9 degrees/s.
    fn pass(&mut self, time: Duration) {
        let step =
            u16::try_from(190 * time.as_millis() / 1_000).expect("short") * u16::from(self.speeds()[0]);
        let (is, wanted) = (self.position(), self.target());
        let next = if wanted > is { wanted.min(is + step) } else { wanted.max(is.saturating_sub(step)) };
        self.take(FINE_POSITION.address, &next.to_le_bytes());
    }

    fn held(&self) -> HeldJoints {
        HeldJoints::of(&self.0)
    }

    fn restart(&mut self) {
        let position = self.position();
        *self = Self::new();
        self.take(SPEED.address, &SPEED.default_bytes());
        self.take(FRAMES_ACCEPTED.address, &[3]);
        for row in [FINE_TARGET, FINE_POSITION] {
            self.take(row.address, &position.to_le_bytes());
        }
    }
}

/// Carries out a stop of an arm. `comes` decides for each frame and each reply whether it arrives.
fn stop(
    hold: &mut Hold,
    arm: &mut PlainArm,
    mut comes: impl FnMut(Duration) -> bool,
) -> (HoldStep, Duration) {
    // As the page does: a round of reads is sent after the previous round was answered or lost.
    let (mut now, mut asked) = (ms(0), ms(0));
    loop {
        match hold.poll(now) {
            HoldStep::Write(frames) => {
                frames.iter().filter(|_| comes(now)).for_each(|(address, values)| arm.take(*address, values));
            }
            HoldStep::Read | HoldStep::Wait(_) => {
                let reply = arm.held();
                arm.pass(ms(20));
                now += ms(20);
                if comes(now) {
                    hold.joints(asked, now, &reply);
                    asked = now;
                } else if now >= asked + ms(100) {
                    asked = now;
                }
            }
            end => return (end, now),
        }
        assert!(now < ms(60_000), "no end");
    }
}

#[test]
fn a_stop_slows_the_joints_down_before_the_first_read() {
    let arm = PlainArm::new();
    let mut hold = Hold::at_once(Some(&arm.held()));
    let HoldStep::Write(frames) = hold.poll(ms(0)) else { panic!("no frames") };
    assert_eq!(frames[..2], [(184, vec![0, 0]), (32, vec![1; 7])]);
    assert_eq!((frames[2].0, &frames[2].1[..2]), (128, &5_000_u16.to_le_bytes()[..]), "where it was last");
    assert_eq!(hold.poll(ms(99)), HoldStep::Read);
    assert_eq!(hold.poll(ms(100)), HoldStep::Write(frames.clone()), "nothing has confirmed it");
    assert_eq!(hold.poll(ms(100)), HoldStep::Read);
    assert_eq!(hold.poll(ms(200)), HoldStep::Write(frames));
}

#[test]
fn an_arm_that_takes_the_frames_and_whose_replies_are_all_lost_stands_still() {
    let mut arm = PlainArm::new();
    let mut hold = Hold::at_once(Some(&arm.held()));
    let (end, now) = stop(&mut hold, &mut arm, |now| now == ms(0) || now >= ms(3_000));
    assert!(matches!(end, HoldStep::Holds(_)) && now >= ms(3_000), "{end:?}");
    assert_eq!((arm.position(), arm.target()), (5_000, 5_000));
    assert_eq!(arm.speeds(), [40, 41, 42, 43, 44, 45, 46], "as before the stop");
}

#[test]
fn a_read_from_before_the_frames_confirms_nothing() {
    let arm = PlainArm::new();
    let mut hold = Hold::at_once(Some(&arm.held()));
    hold.joints(ms(900), ms(950), &arm.held());
    assert!(matches!(hold.poll(ms(1_000)), HoldStep::Write(_)));
    hold.joints(ms(990), ms(1_010), &arm.held());
    assert_eq!(hold.poll(ms(1_010)), HoldStep::Read, "still the frames of the start");
    hold.joints(ms(1_000), ms(1_020), &arm.held());
    let HoldStep::Write(frames) = hold.poll(ms(1_020)) else { panic!("no targets") };
    assert_eq!(frames, [(128, arm.0.values[142..156].to_vec())], "the targets are the measured positions");
}

#[test]
fn a_stop_is_confirmed_whatever_frames_and_replies_are_lost() {
    for seed in 0..300_u64 {
        let mut state = seed;
        let random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % 10
        };
        let (mut arm, mut random) = (PlainArm::new(), random);
        let mut hold = Hold::at_once(Some(&arm.held()));
        let (end, now) = stop(&mut hold, &mut arm, |_| random() < 8);
        assert!(matches!(end, HoldStep::Holds(_)), "seed {seed}: {end:?}");
        assert_eq!(arm.speeds()[6], 46, "seed {seed}");
        let at = arm.position();
        arm.pass(ms(1_000));
        assert!(arm.position().abs_diff(at) <= 200, "seed {seed}: it moves on from {at} after {now:?}");
    }
}

#[test]
fn after_a_restart_the_speeds_are_those_of_power_up() {
    let mut arm = PlainArm::new();
    let mut hold = Hold::at_once(Some(&arm.held()));
    assert!(matches!(hold.poll(ms(0)), HoldStep::Write(_)));
    hold.joints(ms(0), ms(10), &arm.held());
    arm.restart();
    let (end, _) = stop(&mut hold, &mut arm, |_| true);
    assert!(matches!(end, HoldStep::Holds(_)) && hold.has_restarted, "{end:?}");
    assert_eq!(arm.speeds(), SPEED.default_bytes());
}

#[test]
fn a_second_stop_restores_the_speeds_of_before_the_first() {
    let mut arm = PlainArm::new();
    let mut first = Hold::at_once(Some(&arm.held()));
    let HoldStep::Write(frames) = first.poll(ms(0)) else { panic!("no frames") };
    frames.iter().for_each(|(address, values)| arm.take(*address, values));
    let mut second = first.again(Some(&arm.held()));
    stop(&mut second, &mut arm, |_| true);
    assert_eq!(arm.speeds(), [40, 41, 42, 43, 44, 45, 46]);
}

#[test]
fn an_arm_that_takes_nothing_fails_and_one_without_motors_is_left_alone() {
    let mut arm = PlainArm::new();
    let mut refusing = Hold::at_once(Some(&arm.held()));
    let mut now = ms(0);
    let refused = loop {
        match refusing.poll(now) {
            HoldStep::Read => {
                now += ms(20);
                arm.take(
                    FINE_POSITION.address,
                    &u16::try_from(6_000 + now.as_millis()).expect("small").to_le_bytes(),
                );
                refusing.joints(now, now, &arm.held());
            }
            HoldStep::Write(_) => {}
            end => break end,
        }
    };
    assert!(matches!(refused, HoldStep::NotTaken(_)), "{refused:?}");
    arm.take(MOTOR_STATE.address, &[motor_state::DAMPING]);
    let mut limp = Hold::at_once(Some(&arm.held()));
    assert_eq!(limp.poll(ms(0)), HoldStep::Read, "nothing is written");
    limp.joints(ms(0), ms(5), &arm.held());
    assert!(matches!(limp.poll(ms(5)), HoldStep::NotDriven(_)));
}
