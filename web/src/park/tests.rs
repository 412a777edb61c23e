//! Parks of a simulated arm: without a fault, and with faults before the start, on the way and while the arm is watched.

use super::*;
use crate::stop::StopProgress;
use crate::tab::Tab;
use crate::texts::Language;
use crate::words::park_failure;

/// Runs a park to its end. Calls `during` before each picture with its number, for example to inject a fault.
fn park(tab: &mut Tab, mut during: impl FnMut(u32, &mut Tab)) -> ParkProgress {
    let mut park = Park::new(tab.client.registers().clone(), tab.now());
    for picture in 0..4_000 {
        during(picture, tab);
        match park.poll(tab.now(), &mut tab.client) {
            ParkProgress::Moving => tab.pass(1),
            end => return end,
        }
    }
    panic!("it does not end: {park:?}");
}

#[test]
fn an_arm_is_parked_and_has_the_speeds_of_before() {
    let mut tab = Tab::new();
    let before = tab.registers();
    assert_eq!(park(&mut tab, |_, _| ()), ParkProgress::Parked);
    assert_eq!((tab.client.state().motor_state, tab.registers()), (motor_state::DAMPING, before));
}

#[test]
fn a_park_that_fails_says_why_and_the_joints_hold() {
    for (action, word) in [
        ("fault 1=missing", "Joint 1 does not answer"),
        ("fault 3=stuck", "Joint 3 is blocked"),
        ("fault supply=off", "does not answer"),
        ("power-cycle", "restarted"),
        ("halt", "does not answer"),
    ] {
        let mut tab = Tab::new();
        let before = tab.registers();
        let end = park(&mut tab, |picture, tab| {
            if picture == 60 {
                tab.act(action);
            }
        });
        let ParkProgress::Failed(failure) = end else { panic!("{action}: {end:?}") };
        let words = park_failure(Language::English, &failure);
        assert!(words.starts_with("Not parked:") && words.contains(word), "{action}: {words}");
        assert_ne!(tab.client.stop_progress(), StopProgress::None, "{action}: the arm is told to hold");
        tab.pass(60);
        let held = tab.angles();
        tab.pass(120);
        if !matches!(action, "halt" | "fault supply=off") {
            let moved = held.iter().zip(tab.angles()).map(|(held, end)| (held - end).abs());
            assert!(moved.fold(0.0, f64::max) < 0.5, "{action}: {held:?} to {:?}", tab.angles());
            assert_eq!(tab.registers(), before, "{action}");
        }
    }
}

#[test]
fn an_arm_is_not_parked_if_something_happens_while_it_is_watched() {
    for action in ["fault 3=missing", "fault supply=off", "restart", "power-cycle", "halt"] {
        let mut tab = Tab::new();
        let mut acted = false;
        let end = park(&mut tab, |_, tab| {
            if tab.client.state().motor_state == motor_state::DAMPING && !acted {
                acted = true;
                tab.act(action);
            }
        });
        assert!(acted && matches!(end, ParkProgress::Failed(ParkFailure::Move(_))), "{action}: {end:?}");
    }
}

#[test]
fn nothing_is_written_to_an_arm_that_cannot_be_parked() {
    for (action, word) in [("motors", "The motors are off."), ("fault 3=missing", "Joint 3 does not answer")]
    {
        let mut tab = Tab::new();
        if action == "motors" {
            tab.client.write(tab.now(), MOTOR_STATE.address, &[motor_state::FORCELESS]);
        } else {
            tab.act(action);
        }
        tab.pass(60);
        let written = tab.client.frames().count();
        let ParkProgress::Failed(failure) = park(&mut tab, |_, _| ()) else { panic!("{action}") };
        let words = park_failure(Language::English, &failure);
        assert!(words.contains(word), "{action}: {words}");
        assert_eq!(tab.client.frames().count(), written, "{action}");
    }
}

#[test]
fn a_page_that_pauses_ends_its_park() {
    let mut tab = Tab::new();
    let end = park(&mut tab, |picture, tab| {
        if picture == 60 {
            (0..200).for_each(|_| tab.arm.advance(10_000.0, || true));
        }
    });
    assert!(matches!(end, ParkProgress::Failed(ParkFailure::Move(PlayFailure::Paused(_)))), "{end:?}");
}

#[test]
fn a_park_that_something_else_ends_leaves_no_joint_that_goes_on() {
    let mut tab = Tab::new();
    let before = tab.registers();
    let mut park = Park::new(tab.client.registers().clone(), tab.now());
    for _ in 0..90 {
        assert_eq!(park.poll(tab.now(), &mut tab.client), ParkProgress::Moving);
        tab.pass(1);
    }
    assert_ne!(tab.client.state().moving, 0);
    let at_end = tab.angles();
    park.end(tab.now(), &mut tab.client);
    tab.pass(120);
    let moved = at_end.iter().zip(tab.angles()).map(|(end, now)| (end - now).abs());
    assert!(moved.fold(0.0, f64::max) < 2.0, "{at_end:?} to {:?}", tab.angles());
    assert_eq!(tab.registers(), before);
}
