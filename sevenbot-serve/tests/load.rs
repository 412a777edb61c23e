//! Programs under load, in virtual time: no reply is lost, and each program gets the replies to its own requests.
//!
//! `SERVE_LOAD_SECONDS` sets the length; 3600 is an hour.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

mod rig;

use proptest::prelude::*;
use protocol_core::registers::map::{FEEDBACK_FREQUENCY, SPEED};
use rig::{World, read, write};

/// Programs that write and read back registers of their own.
const WRITERS: u8 = 7;

#[test]
fn ten_programs_lose_nothing_and_cross_nothing() {
    let seconds = std::env::var("SERVE_LOAD_SECONDS").map_or(20, |text| text.parse().expect("a number"));
    let mut world = World::new(10);
    for (program, hertz) in [(7, 50), (8, 25), (9, 50)] {
        world.send(program, &write(FEEDBACK_FREQUENCY.address, &[hertz]));
    }
    world.programs[9].reads = false;
    let (mut asked, mut reports, mut noise) = (0_u64, [0_usize; 2], 0_u8);
    for second in 0..seconds {
        for tenth in 0..10_u64 {
            let value = u8::try_from((second * 10 + tenth) % 100).expect("a speed");
            for program in 0..WRITERS {
                let own = SPEED.address + program;
                noise = noise.wrapping_mul(5).wrapping_add(1);
                world.send(program.into(), &[noise, 0xAA, 0x77]);
                world.send(program.into(), &[write(own, &[value]), read(own, 1)].concat());
            }
            world.run(100);
            for program in 0..WRITERS {
                let expected = (SPEED.address + program, vec![value]);
                assert_eq!(world.take(program.into()), [expected], "second {second}");
                asked += 1;
            }
        }
        reports[0] += world.take(7).len();
        reports[1] += world.take(8).len();
    }
    let expected = [50 * seconds, 25 * seconds].map(|count| usize::try_from(count).expect("a count"));
    println!("{seconds} s: {asked} writes read back, {reports:?} reports");
    assert!(
        reports.iter().zip(expected).all(|(found, expected)| found.abs_diff(expected) <= 3),
        "{reports:?}"
    );
}

/// What a program sends: a read of these registers, a write of its own speed register followed by a read of it, or bytes
/// that are no frame.
#[derive(Clone, Debug)]
enum Step {
    Read(u8, u8),
    Write(u8),
    Noise(Vec<u8>),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        (0..240_u8, 0..16_u8).prop_map(|(address, count)| Step::Read(address, count)),
        (0..=100_u8).prop_map(Step::Write),
        proptest::collection::vec(0..0xAA_u8, 0..9).prop_map(Step::Noise),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_requests_cut_anywhere_get_their_own_replies(
        scripts in proptest::collection::vec(proptest::collection::vec(step(), 1..30), 1..6),
        cut in 1..40_usize,
    ) {
        let mut world = World::new(scripts.len());
        let mut streams = vec![Vec::new(); scripts.len()];
        let mut expected = vec![Vec::new(); scripts.len()];
        for (program, script) in scripts.iter().enumerate() {
            for step in script {
                match step {
                    Step::Read(address, count) => {
                        streams[program].extend(read(*address, *count));
                        expected[program].push((*address, usize::from(*count)));
                    }
                    Step::Write(value) => {
                        let own = SPEED.address + u8::try_from(program).unwrap();
                        streams[program].extend([write(own, &[*value]), read(own, 1)].concat());
                        expected[program].push((own, 1));
                    }
                    Step::Noise(bytes) => streams[program].extend(bytes),
                }
            }
        }
        while streams.iter().any(|stream| !stream.is_empty()) {
            for (program, stream) in streams.iter_mut().enumerate() {
                let piece: Vec<u8> = stream.drain(..cut.min(stream.len())).collect();
                world.send(program, &piece);
            }
            world.run(1);
        }
        world.run(1_500);
        for (program, expected) in expected.iter().enumerate() {
            let found: Vec<_> = world.take(program).iter().map(|(a, values)| (*a, values.len())).collect();
            prop_assert_eq!(&found, expected);
        }
    }
}
