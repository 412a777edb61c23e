//! Several programs share an arm: each gets its own replies and reports, and none disturbs the others.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

mod rig;

use protocol_core::registers::map::{
    CHIP_ID, DEVICE_CODE, DEVICE_ID, EEPROM_LOCK, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED,
    OFFSET, PRESENT_POSITION, SPEED, TARGET_POSITION,
};
use protocol_core::registers::map21::{
    ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY, OPTIONS, TIP_POSITION,
};
use rig::{World, read, write, write_map21};

const POSITIONS: (u8, u8) = (PRESENT_POSITION.address, PRESENT_POSITION.count);

/// The program sets the frequency of its reports.
fn set_frequency(world: &mut World, program: usize, hertz: u8) {
    world.send(program, &write(FEEDBACK_FREQUENCY.address, &[hertz]));
}

#[test]
fn each_program_gets_the_replies_to_its_own_requests_in_their_order() {
    let mut world = World::new(3);
    for (program, address) in [SPEED.address, CHIP_ID.address, DEVICE_CODE.address].into_iter().enumerate() {
        (0..50_u8).for_each(|number| world.send(program, &read(address, 1 + number % 3)));
    }
    world.run(2_000);
    for (program, address) in [SPEED.address, CHIP_ID.address, DEVICE_CODE.address].into_iter().enumerate() {
        let shapes: Vec<_> = world.take(program).iter().map(|(a, values)| (*a, values.len())).collect();
        let expected: Vec<_> = (0..50).map(|number| (address, 1 + number % 3)).collect();
        assert_eq!(shapes, expected);
    }
}

#[test]
fn a_program_reads_what_it_wrote_directly_before() {
    let mut world = World::new(4);
    for value in 1..=40 {
        for program in 0..4_u8 {
            let own = SPEED.address + program;
            world.send(program.into(), &[write(own, &[value]), read(own, 1)].concat());
        }
    }
    world.run(3_000);
    for program in 0..4_u8 {
        let values: Vec<_> = world.take(program.into()).into_iter().map(|(_, values)| values[0]).collect();
        assert_eq!(values, (1..=40).collect::<Vec<_>>());
    }
}

#[test]
fn one_reply_answers_equal_reads_that_wait() {
    let mut world = World::new(20);
    let accepted = |world: &World| world.arm.registers().get(FRAMES_ACCEPTED.address);
    world.run(100);
    let before = accepted(&world);
    for program in 0..20 {
        world.send(program, &write(SPEED.address, &[u8::try_from(program).unwrap() + 1]));
        world.send(program, &read(POSITIONS.0, POSITIONS.1));
        world.send(program, &read(SPEED.address, 1));
    }
    world.run(1_000);
    for program in 0..20 {
        let shapes: Vec<_> = world.take(program).iter().map(|(at, values)| (*at, values.len())).collect();
        assert_eq!(shapes, [(POSITIONS.0, 7), (SPEED.address, 1)]);
    }
    let frames = accepted(&world).wrapping_sub(before);
    assert!((22..=40).contains(&frames), "{frames} frames for 20 writes and 40 reads");
}

#[test]
fn each_program_has_its_own_frequency_of_reports() {
    let mut world = World::new(4);
    for (program, hertz) in [50, 20, 7, 0].into_iter().enumerate() {
        set_frequency(&mut world, program, hertz);
    }
    world.run(10_000);
    for (program, hertz) in [50, 20, 7, 0].into_iter().enumerate() {
        let reports = world.take(program);
        assert!(reports.iter().all(|(address, values)| (*address, values.len()) == (POSITIONS.0, 7)));
        assert!(reports.len().abs_diff(10 * hertz) <= 2, "{} reports at {hertz} Hz", reports.len());
        world.send(program, &read(FEEDBACK_FREQUENCY.address, 1));
    }
    (0..3).for_each(|program| set_frequency(&mut world, program, 0));
    world.run(100);
    for (program, hertz) in [50_u8, 20, 7, 0].into_iter().enumerate() {
        assert!(world.take(program).contains(&(FEEDBACK_FREQUENCY.address, vec![hertz])), "its own value");
    }
    assert_eq!(world.arm.registers().get(FEEDBACK_FREQUENCY.address), 0, "the arm sends no reports");
    world.run(100);
    assert!((0..4).all(|program| world.take(program).is_empty()), "all streams have ended");
}

#[test]
fn each_program_has_the_reports_of_its_own_map() {
    let mut world = World::new(3);
    let (angles, loads) = (ANGLE_FEEDBACK_FREQUENCY.address, LOAD_FEEDBACK_FREQUENCY.address);
    set_frequency(&mut world, 0, 50);
    world.send(1, &[write_map21(angles, &[100]), write_map21(loads, &[20])].concat());
    world.send(2, &write_map21(loads, &[5]));
    world.run(10_000);
    let mut count = |program: usize, address: u8| {
        world.programs[program].reports.extract_if(.., |(first, _)| *first == address + 1).count()
    };
    assert!(count(1, angles).abs_diff(1_000) <= 10, "100 Hz");
    assert!(count(1, loads).abs_diff(200) <= 4, "20 Hz");
    assert!(count(2, loads).abs_diff(50) <= 2, "5 Hz");
    assert!(world.programs.iter().all(|program| program.reports.is_empty()), "no other stream");
    assert!(world.take(0).len().abs_diff(500) <= 5, "50 Hz of map 2.2");
    assert_eq!((world.take(1), world.take(2)), (vec![], vec![]));
    let registers = world.arm.registers();
    assert_eq!([angles, loads].map(|address| registers.get(address)), [0; 2], "the arm sends no reports");
}

#[test]
fn the_other_map_stops_the_streams_of_its_own_program_only() {
    let mut world = World::new(2);
    let (angles, loads) = (ANGLE_FEEDBACK_FREQUENCY.address, LOAD_FEEDBACK_FREQUENCY.address);
    set_frequency(&mut world, 0, 50);
    world.send(1, &[write_map21(angles, &[50]), write_map21(loads, &[50])].concat());
    world.run(100);
    world.send(0, &write_map21(0, &[]));
    world.send(1, &write(FEEDBACK_FREQUENCY.address, &[10]));
    world.run(50);
    (0..2).for_each(|program| drop(world.take(program)));
    world.programs[1].reports.clear();
    world.run(1_000);
    assert_eq!(world.take(0), []);
    assert!(world.take(1).len().abs_diff(10) <= 1);
    assert_eq!(world.programs[1].reports, []);
    for (program, values) in [(0, [0, 0, 0]), (1, [10, 0, 0])] {
        read_frequencies(&mut world, program);
        let read: Vec<_> = world.take(program).into_iter().filter(|(_, values)| values.len() == 1).collect();
        let addresses = [FEEDBACK_FREQUENCY.address, angles, loads];
        let expected: Vec<_> = addresses.into_iter().zip(values.map(|value| vec![value])).collect();
        assert_eq!(read, expected);
    }
}

/// The program reads the frequencies of its reports.
fn read_frequencies(world: &mut World, program: usize) {
    for register in [FEEDBACK_FREQUENCY, ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY] {
        world.send(program, &read(register.address, 1));
    }
    world.run(30);
}

#[test]
fn each_program_reads_offsets_as_it_writes_them() {
    let mut world = World::new(3);
    world.send(0, &[write(EEPROM_LOCK.address, &[0]), write(OFFSET.address, &[0x82, 3])].concat());
    world.run(20);
    world.send(1, &write_map21(SPEED.address, &[60]));
    for _ in 0..5 {
        (0..3).for_each(|program| world.send(program, &read(OFFSET.address, 2)));
        world.run(20);
        for (program, form) in [[0x82, 3], [126, 131], [0x82, 3]].into_iter().enumerate() {
            assert_eq!(world.take(program), [(OFFSET.address, form.to_vec())], "program {program}");
        }
    }
}

/// M4: only an accepted write of map 2.1 stops the reports of map 2.2. The arm refuses each request in `refused`.
#[test]
fn a_write_that_the_arm_refuses_stops_no_reports() {
    let far = [0x05, 0xF4, 0x04, 0xB9, 0x04, 0x32, 0x80, 0x80, 0x7F];
    let refused: [(bool, Vec<u8>); 4] = [
        (false, write_map21(TARGET_POSITION.address, &[90, 181])),
        (false, write_map21(TIP_POSITION.address, &far)),
        (true, write_map21(OFFSET.address, &[20])),
        (true, write_map21(DEVICE_ID.address, &[5, 8])),
    ];
    for (unlocks, request) in refused {
        let mut world = World::new(1);
        if unlocks {
            world.send(0, &write(EEPROM_LOCK.address, &[0]));
        }
        set_frequency(&mut world, 0, 50);
        world.send(0, &request);
        world.run(20);
        assert_eq!(world.arm.registers().read(FRAMES_REFUSED.address, 1), [1], "{request:02x?}");
        world.take(0);
        world.run(1_000);
        assert!(world.take(0).len().abs_diff(50) <= 1, "{request:02x?}");
        world.send(0, &write_map21(0, &[]));
        world.run(20);
        world.take(0);
        world.run(200);
        assert_eq!(world.take(0), [], "an accepted one stops them");
    }
}

/// A write to the locked EEPROM is accepted without effect (D15).
#[test]
fn a_write_that_the_lock_makes_harmless_stops_reports() {
    let mut world = World::new(1);
    set_frequency(&mut world, 0, 50);
    world.send(0, &write_map21(OFFSET.address, &[20]));
    world.run(20);
    world.take(0);
    world.run(200);
    assert_eq!(world.take(0), []);
    assert_eq!(world.arm.registers().read(FRAMES_REFUSED.address, 1), [0]);
}

/// M5 and M6: register 20 decides for each program until its own first write, however often others write.
#[test]
fn before_its_first_write_a_program_reads_offsets_as_register_20_says() {
    let mut world = World::new(2);
    world.send(1, &[write(EEPROM_LOCK.address, &[0]), write(OFFSET.address, &[0x82, 3])].concat());
    let reads = |world: &mut World, form: [u8; 2]| {
        for _ in 0..3 {
            world.send(0, &read(OFFSET.address, 2));
            world.send(1, &write(SPEED.address, &[60]));
            world.run(20);
            assert_eq!(world.take(0), [(OFFSET.address, form.to_vec())]);
        }
    };
    world.run(20);
    reads(&mut world, [0x82, 3]);
    world.send(1, &write_map21(OPTIONS.address, &[1]));
    world.run(20);
    reads(&mut world, [126, 131]);
    world.unplug();
    world.run(100);
    world.plug();
    world.run(1_000);
    reads(&mut world, [126, 131]);
    world.send(0, &write(SPEED.address, &[60]));
    reads(&mut world, [0x82, 3]);
}

#[test]
fn reports_end_with_their_program() {
    let mut world = World::new(2);
    set_frequency(&mut world, 0, 50);
    world.run(100);
    world.leave(0);
    world.run(50);
    let before = world.arm.registers().read(246, 2).to_vec();
    world.run(1_000);
    assert_eq!(world.arm.registers().read(246, 2), before, "nobody reads the arm any more");
}

#[test]
fn a_program_that_never_reads_loses_reports_but_no_reply() {
    let mut world = World::new(2);
    set_frequency(&mut world, 0, 50);
    set_frequency(&mut world, 1, 50);
    world.programs[0].reads = false;
    (0..1_000).for_each(|_| world.send(0, &read(SPEED.address, 7)));
    world.run(20_000);
    assert!(world.take(1).len().abs_diff(1_000) <= 3, "the other one has all its reports");
    assert!(world.programs[0].is_waiting(), "its requests wait where it sent them from");
    world.programs[0].reads = true;
    world.run(10_000);
    let received = world.take(0);
    assert_eq!(received.iter().filter(|(address, _)| *address == SPEED.address).count(), 1_000);
}

#[test]
fn half_a_frame_of_one_program_disturbs_no_other() {
    let mut world = World::new(2);
    world.send(0, &write(TARGET_POSITION.address, &[1, 2, 3, 4, 5, 6, 7])[..8]);
    world.send(1, &read(CHIP_ID.address, 6));
    world.run(20);
    assert_eq!(world.take(1), [(CHIP_ID.address, b"SIM\0\0\x01".to_vec())]);
    world.send(0, &read(DEVICE_CODE.address, 1));
    world.run(20);
    assert_eq!(world.take(0), [(DEVICE_CODE.address, vec![7])]);
    assert_eq!(world.arm.registers().get(TARGET_POSITION.address), 90);
}

#[test]
fn without_an_arm_requests_are_dropped_and_later_ones_pass() {
    let mut world = World::new(2);
    set_frequency(&mut world, 1, 50);
    world.send(0, &read(CHIP_ID.address, 6));
    world.run(1);
    world.unplug();
    world.send(0, &[read(DEVICE_CODE.address, 1), write(TARGET_POSITION.address, &[10])].concat());
    world.run(1_000);
    assert_eq!(world.take(0), [], "silence, as on a cable");
    world.take(1);
    world.plug();
    world.run(1_000);
    assert_eq!(world.take(0), []);
    assert_eq!(world.arm.registers().get(TARGET_POSITION.address), 90, "an old target does not move the arm");
    assert!(world.take(1).len() > 30, "reports continue");
    world.send(0, &read(CHIP_ID.address, 6));
    world.run(20);
    assert_eq!(world.take(0), [(CHIP_ID.address, b"SIM\0\0\x01".to_vec())]);
}

#[test]
fn an_arm_that_stops_answering_loses_replies_but_never_crosses_them() {
    let mut world = World::new(2);
    world.arm.halt_controller(world.now);
    (0..2).for_each(|program| world.send(program, &read(POSITIONS.0, POSITIONS.1)));
    // The server waits 3 s for the reply to a read.
    world.run(3_100);
    world.arm.restart_controller(world.now);
    world.run(1_000);
    (0..2).for_each(|program| assert_eq!(world.take(program), []));
    world.send(0, &read(CHIP_ID.address, 1));
    world.send(1, &read(DEVICE_CODE.address, 1));
    world.run(50);
    assert_eq!(world.take(0), [(CHIP_ID.address, vec![b'S'])]);
    assert_eq!(world.take(1), [(DEVICE_CODE.address, vec![7])]);
}

#[test]
fn a_damaged_reply_is_asked_for_again() {
    let mut world = World::new(3);
    world.damages_next_byte = true;
    world.send(0, &read(SPEED.address, 1));
    world.send(1, &read(CHIP_ID.address, 6));
    world.send(2, &read(DEVICE_CODE.address, 1));
    world.run(100);
    assert_eq!(world.take(0), [(SPEED.address, vec![60])]);
    assert_eq!(world.take(1), [(CHIP_ID.address, b"SIM\0\0\x01".to_vec())]);
    assert_eq!(world.take(2), [(DEVICE_CODE.address, vec![7])]);
}

/// While a read has no reply, an equal read asks for a few registers more, so that the replies differ. A read of 255 registers
/// cannot be made longer. So the next one is sent after the end of the one before.
#[test]
fn a_damaged_reply_with_all_registers_costs_no_program_its_own() {
    let mut world = World::new(3);
    world.damages_next_byte = true;
    (0..3).for_each(|program| world.send(program, &read(0, 255)));
    world.run(1_500);
    (0..3).for_each(|program| assert_eq!(world.take(program).len(), 1));
}

/// After a write, a repeated read would return another state than its program asked for.
#[test]
fn a_damaged_reply_is_lost_if_something_was_written_since() {
    let mut world = World::new(2);
    world.damages_next_byte = true;
    world.send(0, &read(SPEED.address, 1));
    world.advance(2);
    world.send(1, &write(SPEED.address, &[10]));
    world.run(3_100);
    assert_eq!(world.take(0), []);
    world.send(0, &read(SPEED.address, 1));
    world.run(20);
    assert_eq!(world.take(0), [(SPEED.address, vec![10])]);
}

#[test]
fn with_read_only_access_nothing_is_written_but_reports_can_be_chosen() {
    let mut world = World::with_access(1, true);
    world.send(0, &write(SPEED.address, &[7]));
    set_frequency(&mut world, 0, 10);
    world.run(1_000);
    assert!(world.take(0).len() >= 9);
    assert_eq!(world.arm.registers().get(SPEED.address), 60);
}
