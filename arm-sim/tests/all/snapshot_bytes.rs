//! A saved and loaded arm behaves exactly as the original does: after random actions, and with an object in its claws.

use arm_sim::request::Request;
use arm_sim::{Action, Duration, Simulation};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use protocol_core::registers::map::{
    EEPROM_LOCK, FEEDBACK_FREQUENCY, FINE_POSITION, FINE_TARGET, OFFSET, SET_POINT_PERIOD,
};

use crate::room::Room;

/// In hundredths of a degree.
const REST: [u16; 7] = [9_000, 9_000, 6_500, 9_000, 9_000, 9_000, 8_000];
/// The first bytes of a write.
const UNFINISHED: [u8; 6] = [0xAA, 0x77, 6, 46, 7, 1];
/// The actions from which the property test chooses.
const ACTIONS: [&str; 34] = [
    "fault 1=missing 700000",
    "fault 2=late=20 1500000",
    "fault 3=garbled=7",
    "fault 4=stuck 900000",
    "fault 5=restarting=900 2000000",
    "fault 1=wall=70/500",
    "fault 2=wall=80 3000000",
    "fault 3=push=700 2000000",
    "fault 7=thing=30/100",
    "fault bus=echo 1000000",
    "fault supply=volts=6.5 2000000",
    "fault supply=dips=300 2000000",
    "fault supply=off 300000",
    "fault flash=fails",
    "fault flash=full",
    "fault line=loss=2%",
    "fault line=corruption=2%",
    "fault line=delay=7",
    "fault arm=supported 1000000",
    "fault arm=goal-starts-torque",
    "clear line",
    "clear",
    "hand 2 400",
    "hold 3",
    "let-go 3",
    "weight 300",
    "drop",
    "trip 5",
    "trip 2 heat",
    "seed 9",
    "disconnect",
    "restart",
    "power-cycle",
    // A table so high that the arm meets it.
    "scene table 190; cube red 40 100 40 260; cylinder can 40 60 200 -40 250; wall shelf 0 280 200 40 50",
];

/// The host sends a point of a stream. Then it sends a read, or now and then another request or a part of one, or disconnects.
fn send_point(arm: &mut Simulation, number: u16) {
    let wave = 200 * (number % 20).abs_diff(10);
    let point: Vec<u8> = REST.iter().flat_map(|angle| (angle + wave).to_le_bytes()).collect();
    arm.send_request(&Request::Write { address: FINE_TARGET.address, values: &point });
    match number % 50 {
        10 => arm.send(&UNFINISHED),
        20 => arm.send_request(&Request::Write { address: EEPROM_LOCK.address, values: &[0] }),
        21 => arm.send_request(&Request::Write { address: OFFSET.address, values: &[1] }),
        30 => drop(arm.act(Action::Disconnect)),
        31 => arm.send_request(&Request::Write { address: FEEDBACK_FREQUENCY.address, values: &[50] }),
        40 => arm.send_request(&Request::WriteMap21 { address: 53, values: &[50] }),
        _ => arm.send_request(&Request::Read { address: FINE_POSITION.address, count: 42 }),
    }
}

/// An arm with reports and a stream. `plans` are actions and their times in microseconds.
fn busy_arm(plans: &[(u64, &str)]) -> Simulation {
    let mut arm = Simulation::default();
    for (micros, action) in plans {
        arm.plan(Duration::from_micros(*micros), action.parse().unwrap());
    }
    arm.advance(Duration::from_millis(500));
    arm.send_request(&Request::Write { address: SET_POINT_PERIOD.address, values: &[20, 0] });
    arm.send_request(&Request::Write { address: FEEDBACK_FREQUENCY.address, values: &[50] });
    arm
}

/// The arm and a copy get the same stream for ten seconds, and answer with the same bytes at the same times. The copy is saved
/// and loaded in each period, often in the middle of a frame.
fn assert_same_for_ten_seconds(mut arm: Simulation) {
    let mut other = arm.clone();
    for number in 0..500 {
        send_point(&mut arm, number);
        send_point(&mut other, number);
        let middle = u64::from(number) * 7_919 % 19_000;
        pass(&mut arm, &mut other, middle);
        other = saved_and_loaded(&other);
        pass(&mut arm, &mut other, 300);
        pass(&mut arm, &mut other, 20_000 - 300 - middle);
    }
    assert_eq!(arm.to_bytes(), other.to_bytes());
}

fn pass(arm: &mut Simulation, other: &mut Simulation, micros: u64) {
    arm.advance(Duration::from_micros(micros));
    other.advance(Duration::from_micros(micros));
    assert_eq!(arm.take_received(), other.take_received());
}

fn saved_and_loaded(arm: &Simulation) -> Simulation {
    Simulation::from_bytes(&arm.to_bytes()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn a_loaded_arm_goes_on_as_the_original(
        plans in vec((0_u64..10_000_000, select(&ACTIONS[..])), 5..40),
    ) {
        assert_same_for_ten_seconds(busy_arm(&plans));
    }
}

#[test]
fn what_an_arm_carries_stays_in_its_claws() {
    let mut room = Room::new("cube red 30 40 0 200; cube blue 30 40 -80 190");
    room.pick(0.0, 200.0, -45.0);
    assert!(saved_and_loaded(&room.0).plant().objects()[0].is_carried);
    assert_same_for_ten_seconds(room.0);
}
