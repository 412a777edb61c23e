//! The guard time on the servo bus: without it, frames meet a servo that still drives the line, and are lost.

use crate::rig::{Rig, config};
use motion_core::{Config, Controller, Storage};
use protocol_core::time::{Duration, Instant};

/// How many frames of the controller collided in two seconds, and how many bus errors it counted, with this guard
/// time in microseconds.
fn losses(guard_us: u64, has_echo: bool) -> (u64, u16) {
    let mut rig = Rig::new();
    rig.plant.set_echo(has_echo);
    let config = Config { guard_time: Duration::from_micros(guard_us), ..config() };
    rig.controller = Controller::new(Instant::ZERO, config, None, Storage::Ready);
    rig.run_ms(500);
    rig.write(46, &[120, 80, 70]);
    rig.run_ms(1_500);
    (rig.plant.collisions(), rig.counter(252))
}

#[test]
fn without_a_guard_time_frames_are_lost_and_with_it_none_are() {
    for has_echo in [false, true] {
        for guard_us in [0, 19] {
            let (collisions, errors) = losses(guard_us, has_echo);
            assert!(collisions > 100 && errors > 10, "{guard_us} us: {collisions} lost, {errors} errors");
        }
        for guard_us in [20, 100] {
            assert_eq!(losses(guard_us, has_echo), (0, 0), "{guard_us} us, echo: {has_echo}");
        }
    }
}
