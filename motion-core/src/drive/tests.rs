use super::*;

fn degrees(degrees: u8) -> MicroDegrees {
    MicroDegrees::from_degrees(degrees)
}

/// A joint that has torque and holds at 40 degrees.
fn engaged() -> Drive {
    let mut drive = Drive::RELEASED;
    drive.wait();
    drive.engage(degrees(40));
    drive.torque_is_on();
    drive
}

/// A joint that fell silent at 41.9 degrees during a move to 80 degrees.
fn silent() -> Drive {
    let mut drive = engaged();
    drive.set_target(degrees(80), 0);
    drive.advance(Instant::ZERO, 100);
    drive.mark_silent();
    drive
}

#[test]
fn d12_a_joint_engages_where_it_is_and_holds() {
    let mut drive = Drive::RELEASED;
    assert_eq!(drive.engage(degrees(40)), None, "the joint is released");
    drive.wait();
    assert!(!drive.is_driven());
    assert_eq!(drive.engage(degrees(40)), Some(Target::Measured));
    drive.advance(Instant::ZERO, 100);
    assert!(drive.is_driven() && !drive.is_moving());
    assert_eq!(drive.set_point(), degrees(40));
    assert_eq!(drive.engage(degrees(50)), None, "only once");
}

#[test]
fn a_target_written_while_waiting_is_approached_at_the_set_speed() {
    let mut drive = Drive::RELEASED;
    drive.set_target(degrees(10), 0);
    drive.wait();
    assert!(!drive.is_moving());
    drive.set_target(degrees(60), 0);
    assert!(drive.is_moving(), "the move is not over");
    assert_eq!(drive.engage(degrees(40)), Some(Target::FromHost));
    drive.advance(Instant::ZERO, 100);
    assert_eq!(drive.set_point(), degrees(40), "the set-point waits for torque");
    drive.torque_is_on();
    drive.advance(Instant::ZERO, 100);
    assert_eq!(drive.set_point(), MicroDegrees(41_900_000), "from the measured position");
}

#[test]
fn d12_a_silent_joint_stops_its_set_point_and_is_driven_on_from_there() {
    for found in [38_900_000, 41_900_000, 44_900_000].map(MicroDegrees) {
        let mut drive = silent();
        drive.advance(Instant::ZERO, 100);
        assert!(!drive.is_driven(), "no goal is sent to it");
        assert_eq!(drive.set_point(), MicroDegrees(41_900_000));
        assert_eq!(drive.engage(found), Some(Target::FromHost));
        drive.torque_is_on();
        drive.advance(Instant::ZERO, 100);
        assert_eq!(drive.set_point(), MicroDegrees(43_800_000), "found at {found:?}");
    }
}

#[test]
fn d12_a_silent_joint_that_is_found_elsewhere_holds_there() {
    for found in [38_899_999, 44_900_001, 170_000_000].map(MicroDegrees) {
        let mut drive = silent();
        assert_eq!(drive.engage(found), Some(Target::Measured));
        assert!(drive.is_driven() && !drive.is_moving(), "the old move is forgotten");
        assert_eq!(drive.set_point(), found);
    }
}

#[test]
fn d12_a_silent_joint_keeps_a_target_that_the_host_writes() {
    let mut elsewhere = silent();
    elsewhere.set_target(degrees(30), 0);
    assert_eq!(elsewhere.engage(degrees(60)), Some(Target::FromHost));
    elsewhere.torque_is_on();
    elsewhere.advance(Instant::ZERO, 100);
    assert_eq!(elsewhere.set_point(), MicroDegrees(58_100_000), "from the measured position");
    let mut near = silent();
    near.set_target(degrees(30), 0);
    near.engage(degrees(42));
    near.torque_is_on();
    near.advance(Instant::ZERO, 100);
    assert_eq!(near.set_point(), degrees(40), "from its set-point");
}

#[test]
fn d12_a_joint_that_falls_silent_before_it_has_torque_engages_where_it_is_found() {
    let mut drive = Drive::RELEASED;
    drive.wait();
    drive.engage(degrees(40));
    drive.mark_silent();
    assert_eq!(drive.engage(degrees(41)), Some(Target::Measured));
    assert_eq!(drive.set_point(), degrees(41));
    drive.set_target(degrees(60), 0);
    drive.mark_silent();
    assert_eq!(drive.engage(degrees(42)), Some(Target::FromHost), "the target is kept");
    assert_eq!(drive.set_point(), degrees(42));
}

#[test]
fn d12_a_joint_that_leaves_its_target_before_it_has_torque_keeps_it() {
    let lost: [fn(&mut Drive); 2] = [|drive| drive.lose_torque(true), Drive::mark_silent];
    for lost in lost {
        let mut drive = Drive::RELEASED;
        drive.wait();
        drive.set_target(degrees(40), 0);
        drive.engage(degrees(40));
        lost(&mut drive);
        assert_eq!(drive.engage(degrees(41)), Some(Target::FromHost));
        assert!(drive.is_moving());
        drive.torque_is_on();
        drive.advance(Instant::ZERO, 100);
        assert_eq!(drive.set_point(), degrees(40));
    }
}

#[test]
fn d12_a_joint_that_falls_silent_again_before_its_torque_was_read_is_driven_on() {
    let mut drive = silent();
    drive.engage(degrees(43));
    drive.mark_silent();
    assert!(drive.is_silent());
    assert_eq!(drive.engage(degrees(43)), Some(Target::FromHost));
    drive.torque_is_on();
    drive.advance(Instant::ZERO, 100);
    assert_eq!(drive.set_point(), MicroDegrees(43_800_000), "from its set-point");
}

#[test]
fn silence_changes_nothing_for_a_joint_that_is_not_driven() {
    let mut drive = Drive::RELEASED;
    drive.mark_silent();
    assert_eq!(drive.engage(degrees(1)), None, "a released joint stays released");
    drive.wait();
    drive.set_target(degrees(60), 0);
    drive.mark_silent();
    assert_eq!(drive.engage(degrees(40)), Some(Target::FromHost), "the target is kept");
}

#[test]
fn a_new_offset_rebases_the_set_point_of_a_driven_and_of_a_silent_joint() {
    let mut released = Drive::RELEASED;
    released.rebase_offset(degrees(1), degrees(1), 0);
    assert_eq!(released.set_point(), MicroDegrees(0));
    for mut drive in [engaged(), silent()] {
        drive.rebase_offset(degrees(43), degrees(40), 0);
        assert_eq!(drive.set_point(), degrees(43));
        assert!(drive.is_moving());
    }
}
