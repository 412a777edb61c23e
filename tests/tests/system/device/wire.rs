//! Frames on the line: `docs/protocol.md`, section 2.

use std::thread::sleep;
use std::time::{Duration, Instant};

use system_tests::frames::{reply, with_checksum};
use system_tests::registers::{
    EFFECTOR_TYPE, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_CORRUPTED, FRAMES_REFUSED, LAST_REFUSAL,
    MOTOR_STATE, PRESENT_POSITION, STANDARD_POSE, TARGET_POSITION, VACUUM_PUMP,
};
use system_tests::wait::TIMEOUT;
use system_tests::{Need, TestSetup, read_request, with_arm, write_request};

/// The header of a write of 255 values. A deframer may wait for the rest of this frame of 262 bytes.
const FALSE_HEADER: [u8; 5] = [0xAA, 0x77, 0x06, 0x10, 0xFF];

/// The documented examples, with an arm in its standard pose.
#[test]
fn d01_the_documented_requests_have_the_documented_replies() {
    with_arm(TestSetup::any().needs(Need::FreshArm), |arm| {
        arm.send(&[0xaa, 0x77, 0x03, 0x36, 0x07, 0x81, 0xce]);
        // On a busy machine the servos get torque late, and joint 3 sags by its weight.
        let documented = [0xaa, 0x77, 0x03, 0x36, 0x07, 0x5a, 0x5a, 0x41, 0x5a, 0x5a, 0x5a, 0x50, 0x43, 0x81];
        let sagged = with_checksum(&[0xaa, 0x77, 0x03, 0x36, 0x07, 0x5a, 0x5a, 0x42, 0x5a, 0x5a, 0x5a, 0x50]);
        let found = arm.frame_within(TIMEOUT).expect("a reply");
        assert!(found == documented || found == sagged, "{found:02x?}");
        arm.send(&[0xaa, 0x77, 0x06, 0x1c, 0x01, 0x00, 0x2c, 0xc4]);
        assert_eq!(arm.register(28), 0, "the EEPROM lock is open");
        arm.send(&[0xaa, 0x77, 0x06, 0x2e, 0x07, 0x5a, 0x5a, 0x41, 0x5a, 0x5a, 0x5a, 0x50, 0xf9, 0x91]);
        assert_eq!(arm.read(TARGET_POSITION, 7), STANDARD_POSE);
        arm.send(&[0xaa, 0x77, 0x03, 0x0a, 0x00, 0xd1, 0x0c]);
        arm.expect(&[0xaa, 0x77, 0x03, 0x0a, 0x00, 0xd1, 0x0c]);
        arm.send(&[0xaa, 0x77, 0x06, 0x35, 0x01, 0x1e, 0x7d, 0x04]);
        assert_eq!(arm.register(FEEDBACK_FREQUENCY), 30);
    });
}

/// D1: the longest frames in both directions.
#[test]
fn d01_the_longest_write_and_the_longest_reply_are_complete() {
    with_arm(TestSetup::any(), |arm| {
        let mut all = arm.read(0, 255);
        assert_eq!(all.len(), 255);
        all[usize::from(EFFECTOR_TYPE)] ^= 1;
        let expected = all[usize::from(EFFECTOR_TYPE)];
        arm.write(0, &all);
        assert_eq!(arm.register(EFFECTOR_TYPE), expected, "262 bytes arrived");
        assert_eq!(arm.read(1, 255).len(), 255);
        arm.expect_nothing_more();
    });
}

/// D2: a range past address 255 is refused, counted and reported.
#[test]
fn d02_a_malformed_range_is_counted_and_has_no_effect() {
    with_arm(TestSetup::any(), |arm| {
        let refused = arm.counter(FRAMES_REFUSED);
        arm.send(&with_checksum(&[0xAA, 0x77, 0x03, 200, 100]));
        arm.expect_nothing_more();
        assert_eq!(arm.read(LAST_REFUSAL, 2), [1, 200]);
        let mut write = vec![0xAA, 0x77, 0x06, 30, 227];
        write.extend([1; 227]);
        arm.send(&with_checksum(&write));
        arm.expect_nothing_more();
        assert_eq!(arm.register(EFFECTOR_TYPE), 0);
        assert_eq!(arm.read(LAST_REFUSAL, 2), [1, 30]);
        assert_eq!(arm.counter(FRAMES_REFUSED), refused.wrapping_add(2));
    });
}

/// D2: a range that ends at address 255 is well formed, and so is an empty one.
#[test]
fn d02_the_last_register_and_an_empty_range_are_well_formed() {
    with_arm(TestSetup::any(), |arm| {
        let refused = arm.counter(FRAMES_REFUSED);
        assert_eq!(arm.read(255, 1).len(), 1);
        arm.send(&read_request(255, 0));
        arm.expect(&reply(255, &[]));
        let accepted = arm.counter(FRAMES_ACCEPTED);
        arm.write(EFFECTOR_TYPE, &[]);
        arm.expect_nothing_more();
        // The empty write, the empty read, and the read of the counter itself.
        let now = arm.counter(FRAMES_ACCEPTED);
        assert!(now.wrapping_sub(accepted) >= 3, "an empty write is counted: {accepted}, {now}");
        assert_eq!(arm.counter(FRAMES_REFUSED), refused);
    });
}

/// D3: every good frame is executed, with any bytes around it.
#[test]
fn d03_good_frames_have_replies_with_any_bytes_between_them() {
    let mut wrong_crc = read_request(0, 3);
    wrong_crc[6] ^= 0x40;
    let mut truncated = write_request(EFFECTOR_TYPE, &[1]);
    truncated.truncate(6);
    let mut lost_byte = read_request(0, 3);
    lost_byte.remove(4);
    let between: [(&str, &[u8]); 10] = [
        ("text", b"AT+RST\r\n"),
        ("zeros", &[0; 300]),
        ("another header", &[0xAA, 0x55]),
        ("the first byte of a header", &[0xAA]),
        ("a repeated header", &[0xAA, 0x77, 0xAA, 0x77]),
        ("an unknown function", &with_checksum(&[0xAA, 0x77, 0x10, 0, 3])),
        ("an invalid checksum", &wrong_crc),
        ("a truncated write", &truncated),
        ("a frame that lost a byte", &lost_byte),
        ("a false header", &FALSE_HEADER),
    ];
    with_arm(TestSetup::any(), |arm| {
        for (address, (what, garbage)) in (0..).zip(between) {
            arm.send(&[garbage, &read_request(address, 3), garbage, &read_request(address, 2)].concat());
            let replies = [arm.reply(), arm.reply()].map(|reply| (reply.address, reply.values.len()));
            assert_eq!(replies, [(address, 3), (address, 2)], "after {what}");
        }
        assert_eq!(arm.register(EFFECTOR_TYPE), 0, "no truncated write was executed");
    });
}

/// D3: frames in random noise.
#[test]
fn d03_no_frame_is_lost_in_noise() {
    const SEED: u64 = 0x7B07;
    let mut state = SEED;
    let mut random = move || {
        // Knuth's MMIX generator. Its upper bits are the most random.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u8::try_from(state >> 56).expect("eight bits")
    };
    with_arm(TestSetup::any(), |arm| {
        for round in 0..200_u8 {
            let noise: Vec<u8> = (0..random() % 40).map(|_| random()).collect();
            arm.send(&[noise.as_slice(), &read_request(round, 1)].concat());
            assert_eq!(arm.reply().address, round, "seed {SEED:#x}, after {noise:02x?}");
        }
        arm.expect_nothing_more();
    });
}

/// D3: a frame with an invalid checksum is counted and has no other effect.
#[test]
fn d03_an_invalid_checksum_is_counted() {
    with_arm(TestSetup::any(), |arm| {
        let corrupted = arm.counter(FRAMES_CORRUPTED);
        let mut corrupted_write = write_request(EFFECTOR_TYPE, &[1]);
        corrupted_write[7] ^= 1;
        arm.send(&corrupted_write);
        arm.expect_nothing_more();
        assert_eq!(arm.counter(FRAMES_CORRUPTED), corrupted.wrapping_add(1));
        assert_eq!(arm.register(EFFECTOR_TYPE), 0);
    });
}

/// D4: a false header delays the next frame by the gap only, not by the 100 ms of its timeout.
///
/// A busy machine only adds delays, so one quick reply is a proof.
#[test]
fn d04_a_false_header_delays_a_good_frame_by_the_gap_only() {
    with_arm(TestSetup::any(), |arm| {
        arm.wait_until("a reply arrives before the timeout of the false header", |arm| {
            let start = Instant::now();
            arm.send(&[FALSE_HEADER.as_slice(), &read_request(0, 1)].concat());
            assert_eq!(arm.reply().address, 0);
            let is_quick = start.elapsed() < Duration::from_millis(90);
            // Wait until the false header has timed out, before the next try.
            sleep(Duration::from_millis(150));
            is_quick
        });
    });
}

/// D4: a frame may contain a pause, as USB serial adapters insert it.
///
/// If the machine extends the pause to 100 ms, the arm drops the frame, and the test tries again.
#[test]
fn d04_a_frame_with_a_pause_is_executed() {
    with_arm(TestSetup::any(), |arm| {
        let frame = write_request(EFFECTOR_TYPE, &[1]);
        arm.wait_until("a frame with a pause is executed", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            arm.send(&frame[..4]);
            sleep(Duration::from_millis(20));
            arm.send(&frame[4..]);
            arm.register(EFFECTOR_TYPE) == 1
        });
    });
}

/// D4: a frame inside an incomplete one is executed. The outer one is executed too when its end arrives.
#[test]
fn d04_an_overtaken_frame_is_executed_when_it_is_complete() {
    with_arm(TestSetup::any(), |arm| {
        let inner = read_request(0, 1);
        // The present values, and a complete read at addresses without registers.
        let values = [vec![1], arm.read(VACUUM_PUMP, 30), inner, vec![0; 3]].concat();
        let outer = write_request(EFFECTOR_TYPE, &values);
        let (head, tail) = outer.split_at(outer.len() - 5);
        // If the machine extends the pause to 100 ms, the arm drops the outer frame.
        arm.wait_until("the outer write is executed after the inner read", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            arm.send(head);
            assert_eq!(arm.reply().address, 0, "the reply to the inner read in the pause");
            arm.send(tail);
            arm.register(EFFECTOR_TYPE) == 1
        });
        arm.expect_nothing_more();
    });
}

/// D4: an incomplete frame is dropped after a timeout, and later bytes do not complete it.
#[test]
fn d04_an_incomplete_frame_is_dropped_after_a_timeout() {
    with_arm(TestSetup::any(), |arm| {
        let frame = write_request(EFFECTOR_TYPE, &[1]);
        // A simulator that is delayed for the whole silence does not detect it.
        arm.wait_until("the end of a frame arrives too late", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            arm.send(&frame[..6]);
            sleep(Duration::from_secs(1));
            arm.send(&frame[6..]);
            arm.register(EFFECTOR_TYPE) == 0
        });
        arm.send(&frame);
        assert_eq!(arm.register(EFFECTOR_TYPE), 1, "the next complete frame is executed");
    });
}

/// D5: a host that reads late receives all replies in order.
#[test]
fn d05_a_host_that_reads_late_receives_a_thousand_replies_in_order() {
    with_arm(TestSetup::any(), |arm| {
        let requests: Vec<(u8, u8)> = (0..1_000_u16).map(|n| ((n % 200).to_le_bytes()[0], 55)).collect();
        let bytes = requests.iter().flat_map(|&(address, count)| read_request(address, count)).collect();
        let sender = arm.send_in_background(bytes);
        sleep(Duration::from_millis(500));
        for (n, &(address, count)) in requests.iter().enumerate() {
            let reply = arm.reply();
            assert_eq!((reply.address, reply.values.len()), (address, usize::from(count)), "reply {n}");
        }
        sender.join().expect("all was sent");
        arm.expect_nothing_more();
    });
}

/// D5: a read after a write returns the written value.
#[test]
fn d05_requests_are_executed_in_order() {
    with_arm(TestSetup::any(), |arm| {
        let (on, off) = (write_request(EFFECTOR_TYPE, &[1]), write_request(EFFECTOR_TYPE, &[0]));
        let read = read_request(EFFECTOR_TYPE, 1);
        arm.send(&[on.as_slice(), &read, &off, &read, &on, &read].concat());
        let values = [arm.reply(), arm.reply(), arm.reply()].map(|reply| reply.values[0]);
        assert_eq!(values, [1, 0, 1]);
    });
}

/// D6: no write has a reply, accepted, refused or without effect.
#[test]
fn d06_writes_have_no_reply() {
    with_arm(TestSetup::any(), |arm| {
        arm.write(EFFECTOR_TYPE, &[1]);
        arm.write(MOTOR_STATE, &[77]);
        arm.write(PRESENT_POSITION, &[1]);
        arm.write(VACUUM_PUMP, &[]);
        arm.expect_nothing_more();
    });
}

#[test]
fn frames_sent_byte_by_byte_have_the_same_replies() {
    with_arm(TestSetup::any(), |arm| {
        let stream = [read_request(0, 2), write_request(EFFECTOR_TYPE, &[1]), read_request(30, 1)].concat();
        // If the machine pauses for 100 ms, the arm drops a frame, and the test tries again.
        arm.wait_until("all frames are executed", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            for &byte in &stream {
                arm.send(&[byte]);
            }
            // The reply to this read comes last, and is the only empty one.
            arm.send(&read_request(0, 0));
            let values = std::iter::from_fn(|| Some(arm.reply().values).filter(|values| !values.is_empty()));
            values.collect::<Vec<_>>() == [vec![7, 30], vec![1]]
        });
    });
}

/// Another client may open the port after the first has closed it.
#[test]
fn clients_come_and_go() {
    with_arm(TestSetup::any(), |arm| {
        for round in 0..5 {
            arm.write(EFFECTOR_TYPE, &[round & 1]);
            arm.send(&read_request(0, 200));
            // Closes the port without reading the reply. The next client may receive it or not.
            arm.reopen(115_200);
            arm.drain();
            assert_eq!(arm.register(EFFECTOR_TYPE), round & 1);
        }
    });
}
