//! How long a joint may stay blocked before its servo gets too hot (D27, D28).

use crate::rig::Rig;
use arm_sim::plant::Wall;
use protocol_core::registers::Joint;

const PUSH_LIMIT: u8 = 193;
const BLOCKED: u8 = 195;
const ALARMS: u8 = 197;
const HEAT: u8 = 1 << 2;
const MINUTES: u64 = 30;

/// The seconds from the write of the target to the alarm, if there is one, and the temperature at the end. Joint 1 is
/// blocked within the first 4 s.
fn seconds_to_alarm(limit: u8) -> (Option<u64>, u8) {
    let mut rig = Rig::started();
    rig.write(PUSH_LIMIT, &[limit]);
    rig.plant.set_wall(Joint::ALL[0], Some(Wall { millidegrees: 100_000, stiffness: None }));
    rig.write(46, &[120]);
    rig.run_ms(4_000);
    assert_eq!(rig.get(BLOCKED), 1, "{limit} %");
    for second in 4..MINUTES * 60 {
        if rig.get(ALARMS) & HEAT != 0 {
            return (Some(second), rig.get(255));
        }
        rig.run_ms(1_000);
        rig.forget();
    }
    (None, rig.get(255))
}

#[test]
#[ignore = "simulates two hours; prints the figures of docs/reliability.md"]
fn d28_a_blocked_joint_gets_too_hot_at_the_default_limit_and_not_at_60_percent() {
    let times = [40, 50, 60, 70].map(|limit| (limit, seconds_to_alarm(limit)));
    for (limit, (seconds, celsius)) in times {
        println!("{limit} %: alarm after {seconds:?} s, then {celsius} degrees Celsius");
    }
    let is_hot = times.map(|(_, (seconds, _))| seconds.is_some());
    assert_eq!(is_hot, [false, false, false, true]);
}
