//! Frames on the line: `docs/protocol.md`, section 2.

use std::thread::sleep;
use std::time::{Duration, Instant};

use system_tests::frames::{reply, sealed};
use system_tests::registers::{
    EFFECTOR_TYPE, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_CORRUPTED, FRAMES_REFUSED, LAST_REFUSAL,
    MOTOR_STATE, PRESENT_POSITION, STANDARD_POSE, TARGET_POSITION, VACUUM_PUMP,
};
use system_tests::{Need, Setup, read_request, with_arm, write_request};

/// Begins like a write of 255 values: a deframer that believes it waits for 262 bytes.
const FALSE_HEADER: [u8; 5] = [0xAA, 0x77, 0x06, 0x10, 0xFF];

/// The documented examples, byte by byte, against an arm in its standard pose.
#[test]
fn d01_the_documented_frames_are_understood_and_answered_byte_by_byte() {
    with_arm(Setup::any().needs(Need::FreshArm), |arm| {
        arm.send(&[0xaa, 0x77, 0x03, 0x36, 0x07, 0x81, 0xce]);
        arm.expect(&[0xaa, 0x77, 0x03, 0x36, 0x07, 0x5a, 0x5a, 0x41, 0x5a, 0x5a, 0x5a, 0x50, 0x43, 0x81]);
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

/// D1: the longest frames there are, both ways.
#[test]
fn d01_the_longest_write_and_the_longest_read_are_whole() {
    with_arm(Setup::any(), |arm| {
        let mut all = arm.read(0, 255);
        assert_eq!(all.len(), 255);
        all[usize::from(EFFECTOR_TYPE)] ^= 1;
        let wanted = all[usize::from(EFFECTOR_TYPE)];
        arm.write(0, &all);
        assert_eq!(arm.register(EFFECTOR_TYPE), wanted, "262 bytes arrived");
        assert_eq!(arm.read(1, 255).len(), 255);
        arm.expect_nothing_more();
    });
}

/// D2: a range that reaches past 255 is no frame, but it is counted, and says where it was.
#[test]
fn d02_a_malformed_range_is_counted_and_has_no_effect() {
    with_arm(Setup::any(), |arm| {
        let refused = arm.counter(FRAMES_REFUSED);
        arm.send(&sealed(&[0xAA, 0x77, 0x03, 200, 100]));
        arm.expect_nothing_more();
        assert_eq!(arm.read(LAST_REFUSAL, 2), [1, 200]);
        let mut write = vec![0xAA, 0x77, 0x06, 30, 227];
        write.extend([1; 227]);
        arm.send(&sealed(&write));
        arm.expect_nothing_more();
        assert_eq!(arm.register(EFFECTOR_TYPE), 0);
        assert_eq!(arm.read(LAST_REFUSAL, 2), [1, 30]);
        assert_eq!(arm.counter(FRAMES_REFUSED), refused.wrapping_add(2));
    });
}

/// D2: up to and with address 255 a range is well formed, and so is an empty one.
#[test]
fn d02_the_last_register_and_an_empty_range_are_well_formed() {
    with_arm(Setup::any(), |arm| {
        let refused = arm.counter(FRAMES_REFUSED);
        assert_eq!(arm.read(255, 1).len(), 1);
        arm.send(&read_request(255, 0));
        arm.expect(&reply(255, &[]));
        let accepted = arm.counter(FRAMES_ACCEPTED);
        arm.write(EFFECTOR_TYPE, &[]);
        arm.expect_nothing_more();
        // The empty write, the empty read behind it, and the read of the counter itself.
        let now = arm.counter(FRAMES_ACCEPTED);
        assert!(now.wrapping_sub(accepted) >= 2, "an empty write is a frame: {accepted}, {now}");
        assert_eq!(arm.counter(FRAMES_REFUSED), refused);
    });
}

/// D3: every good frame is carried out, whatever stands around it.
#[test]
fn d03_good_frames_are_answered_whatever_stands_between_them() {
    let mut wrong_crc = read_request(0, 3);
    wrong_crc[6] ^= 0x40;
    let mut truncated = write_request(EFFECTOR_TYPE, &[1]);
    truncated.truncate(6);
    let mut lost_byte = read_request(0, 3);
    lost_byte.remove(4);
    let between: [(&str, &[u8]); 10] = [
        ("text", b"AT+RST\r\n"),
        ("zeros", &[0; 300]),
        ("a header that is none", &[0xAA, 0x55]),
        ("half a header", &[0xAA]),
        ("a header, doubled", &[0xAA, 0x77, 0xAA, 0x77]),
        ("an unknown function", &sealed(&[0xAA, 0x77, 0x10, 0, 3])),
        ("a wrong checksum", &wrong_crc),
        ("a truncated write", &truncated),
        ("a frame that lost a byte", &lost_byte),
        ("a false header", &FALSE_HEADER),
    ];
    with_arm(Setup::any(), |arm| {
        for (address, (what, garbage)) in (0..).zip(between) {
            arm.send(&[garbage, &read_request(address, 3), garbage, &read_request(address, 2)].concat());
            let answers = [arm.reply(), arm.reply()].map(|reply| (reply.address, reply.values.len()));
            assert_eq!(answers, [(address, 3), (address, 2)], "after {what}");
        }
        assert_eq!(arm.register(EFFECTOR_TYPE), 0, "no truncated write was carried out");
    });
}

/// D3: noise that never repeats, with frames in it.
#[test]
fn d03_no_frame_is_lost_in_noise() {
    const SEED: u64 = 0x7B07;
    let mut state = SEED;
    let mut random = move || {
        // Knuth's MMIX generator; its upper bits are the random ones.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u8::try_from(state >> 56).expect("eight bits")
    };
    with_arm(Setup::any(), |arm| {
        for round in 0..200_u8 {
            let noise: Vec<u8> = (0..random() % 40).map(|_| random()).collect();
            arm.send(&[noise.as_slice(), &read_request(round, 1)].concat());
            assert_eq!(arm.reply().address, round, "seed {SEED:#x}, behind {noise:02x?}");
        }
        arm.expect_nothing_more();
    });
}

/// D3: a wrong checksum is counted, and nothing else comes of it.
#[test]
fn d03_a_wrong_checksum_is_counted() {
    with_arm(Setup::any(), |arm| {
        let corrupted = arm.counter(FRAMES_CORRUPTED);
        let mut damaged = write_request(EFFECTOR_TYPE, &[1]);
        damaged[7] ^= 1;
        arm.send(&damaged);
        arm.expect_nothing_more();
        assert_eq!(arm.counter(FRAMES_CORRUPTED), corrupted.wrapping_add(1));
        assert_eq!(arm.register(EFFECTOR_TYPE), 0);
    });
}

/// D4: a false header does not hold up the frame behind it for the 100 ms of its own time-out.
///
/// A busy machine only ever adds delay, so one quick answer proves it, however many tries it takes.
#[test]
fn d04_a_false_header_holds_up_a_good_frame_only_for_the_gap() {
    with_arm(Setup::any(), |arm| {
        arm.wait_until("an answer comes before the false header is given up", |arm| {
            let start = Instant::now();
            arm.send(&[FALSE_HEADER.as_slice(), &read_request(0, 1)].concat());
            assert_eq!(arm.reply().address, 0);
            let is_quick = start.elapsed() < Duration::from_millis(90);
            // Until the false header is given up, so that every try starts afresh.
            sleep(Duration::from_millis(150));
            is_quick
        });
    });
}

/// D4: a sender that pauses inside a frame, as USB serial adapters do, loses nothing.
///
/// Where the machine makes the pause longer than 100 ms, the arm is right to give the frame up: another try.
#[test]
fn d04_a_frame_with_a_pause_in_it_is_carried_out() {
    with_arm(Setup::any(), |arm| {
        let frame = write_request(EFFECTOR_TYPE, &[1]);
        arm.wait_until("a frame with a pause is carried out", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            arm.send(&frame[..4]);
            sleep(Duration::from_millis(20));
            arm.send(&frame[4..]);
            arm.register(EFFECTOR_TYPE) == 1
        });
    });
}

/// D4: a frame behind an unfinished one is carried out, and then the unfinished one when its end comes.
#[test]
fn d04_an_overtaken_frame_is_carried_out_when_it_is_finished() {
    with_arm(Setup::any(), |arm| {
        let inner = read_request(0, 1);
        // What is there already, and behind it, where no register is, a complete read.
        let values = [vec![1], arm.read(VACUUM_PUMP, 30), inner, vec![0; 3]].concat();
        let outer = write_request(EFFECTOR_TYPE, &values);
        let (head, tail) = outer.split_at(outer.len() - 5);
        // Where the machine makes the pause longer than 100 ms, the arm is right to give the outer one up.
        arm.wait_until("the outer write is carried out behind the inner read", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            arm.send(head);
            assert_eq!(arm.reply().address, 0, "the inner read is answered in the pause");
            arm.send(tail);
            arm.register(EFFECTOR_TYPE) == 1
        });
        arm.expect_nothing_more();
    });
}

/// D4: after a long silence an unfinished frame is given up, and what comes later is not its end.
#[test]
fn d04_an_unfinished_frame_is_abandoned_after_a_long_silence() {
    with_arm(Setup::any(), |arm| {
        let frame = write_request(EFFECTOR_TYPE, &[1]);
        // A simulator that is held up for as long as the silence takes it for none.
        arm.wait_until("the end of a frame comes too late", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            arm.send(&frame[..6]);
            sleep(Duration::from_secs(1));
            arm.send(&frame[6..]);
            arm.register(EFFECTOR_TYPE) == 0
        });
        arm.send(&frame);
        assert_eq!(arm.register(EFFECTOR_TYPE), 1, "the next whole one is carried out");
    });
}

/// D5: a host that does not read for a while loses no answer, and gets them in order.
#[test]
fn d05_a_thousand_requests_are_answered_in_order_to_a_host_that_reads_late() {
    with_arm(Setup::any(), |arm| {
        let requests: Vec<(u8, u8)> = (0..1_000_u16).map(|n| ((n % 200).to_le_bytes()[0], 55)).collect();
        let bytes = requests.iter().flat_map(|&(address, count)| read_request(address, count)).collect();
        let sender = arm.send_in_background(bytes);
        sleep(Duration::from_millis(500));
        for (n, &(address, count)) in requests.iter().enumerate() {
            let reply = arm.reply();
            assert_eq!((reply.address, reply.values.len()), (address, usize::from(count)), "answer {n}");
        }
        sender.join().expect("all was sent");
        arm.expect_nothing_more();
    });
}

/// D5: a read behind a write sees what was written.
#[test]
fn d05_requests_are_carried_out_in_their_order() {
    with_arm(Setup::any(), |arm| {
        let (on, off) = (write_request(EFFECTOR_TYPE, &[1]), write_request(EFFECTOR_TYPE, &[0]));
        let read = read_request(EFFECTOR_TYPE, 1);
        arm.send(&[on.as_slice(), &read, &off, &read, &on, &read].concat());
        let seen = [arm.reply(), arm.reply(), arm.reply()].map(|reply| reply.values[0]);
        assert_eq!(seen, [1, 0, 1]);
    });
}

/// D6: no write is ever answered: accepted, refused or without effect.
#[test]
fn d06_writes_are_not_answered() {
    with_arm(Setup::any(), |arm| {
        arm.write(EFFECTOR_TYPE, &[1]);
        arm.write(MOTOR_STATE, &[77]);
        arm.write(PRESENT_POSITION, &[1]);
        arm.write(VACUUM_PUMP, &[]);
        arm.expect_nothing_more();
    });
}

/// Any cutting of the stream means the same.
#[test]
fn frames_sent_byte_by_byte_are_answered_like_whole_ones() {
    with_arm(Setup::any(), |arm| {
        let stream = [read_request(0, 2), write_request(EFFECTOR_TYPE, &[1]), read_request(30, 1)].concat();
        // Where the machine pauses for too long, the arm is right to give a frame up: another try.
        arm.wait_until("all frames are carried out", |arm| {
            arm.write(EFFECTOR_TYPE, &[0]);
            for &byte in &stream {
                arm.send(&[byte]);
            }
            // Its answer comes last, and is the only empty one.
            arm.send(&read_request(0, 0));
            let answers = std::iter::from_fn(|| Some(arm.reply().values).filter(|values| !values.is_empty()));
            answers.collect::<Vec<_>>() == [vec![7, 30], vec![1]]
        });
    });
}

/// A client may go and another one come; the arm does not mind.
#[test]
fn clients_come_and_go() {
    with_arm(Setup::any(), |arm| {
        for round in 0..5 {
            arm.write(EFFECTOR_TYPE, &[round & 1]);
            arm.send(&read_request(0, 200));
            // Gone without taking the answer, which may or may not be there for the next one.
            arm.reopen(115_200);
            arm.quieten();
            assert_eq!(arm.register(EFFECTOR_TYPE), round & 1);
        }
    });
}
