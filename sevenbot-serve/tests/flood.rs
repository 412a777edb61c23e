//! A flood of one client delays the others by less than 10 ms, in virtual time. Also tests frames and
//! messages for which there is no room.
//!
//! The clients with frames stand for programs at pseudo-terminals and over TCP: the server uses the same client for both.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

mod rig;

use protocol_core::registers::map::{MOTOR_STATE, PRESENT_POSITION, TARGET_POSITION};
use protocol_core::time::Duration;
use rig::{World, read, write, write_map21};

const READ: (u8, u8) = (PRESENT_POSITION.address, PRESENT_POSITION.count);
const READ_MESSAGE: &str = r#"{"cmd":"read","id":54,"num":7}"#;

/// The client whose replies are timed.
#[derive(Clone, Copy, Debug)]
enum Other {
    Frames,
    Page,
}

impl Other {
    fn round_trip(self, world: &mut World) -> Duration {
        match self {
            Self::Frames => world.round_trip(0, &read(READ.0, READ.1)),
            Self::Page => world.page_round_trip(0, READ_MESSAGE),
        }
    }

    /// The longest round trip, with `refill` before each.
    fn slowest(self, world: &mut World, turns: u64, refill: impl Fn(&mut World)) -> u64 {
        let times = (0..turns).map(|turn| {
            refill(world);
            world.run(turn % 7);
            self.round_trip(world).as_micros()
        });
        times.max().unwrap()
    }

    /// Checks how much longer a reply takes during a flood.
    #[track_caller]
    fn check(self, flood: &str, refill: impl Fn(&mut World)) {
        let mut world = World::new(2);
        (0..2).for_each(|_| world.join_page());
        let alone = self.slowest(&mut world, 50, |_| {});
        let cost = self.slowest(&mut world, 200, refill).saturating_sub(alone);
        println!("{flood} cost {self:?} {cost} us more than {alone} us");
        assert!(cost < 10_000, "{flood} cost {self:?} {cost} us more than {alone} us");
    }
}

#[test]
fn a_flood_of_frames_costs_the_others_less_than_10_ms() {
    let floods = [
        ("reads", read(READ.0, READ.1)),
        ("targets", write(TARGET_POSITION.address, &[90, 90, 65, 90, 90, 90, 80])),
        ("positions for IK5", write_map21(68, &[4, 100, 4, 200, 4, 150])),
        ("headers", vec![0xAA; 14]),
        ("starts of frames", b"\xAA\x77\x06\x00\xFF".to_vec()),
    ];
    for other in [Other::Frames, Other::Page] {
        for (name, flood) in &floods {
            other.check(name, |world| {
                while world.programs[1].to_send_bytes() < 4_000 {
                    world.send(1, flood);
                }
            });
        }
    }
}

#[test]
fn a_flood_of_messages_costs_the_others_less_than_10_ms() {
    let floods = [
        READ_MESSAGE,
        r#"{"cmd":"angles","angles":[90,90,65,90,90,90,80]}"#,
        r#"{"cmd":"IK6","pos":[0,250,100],"vec56":[0,0,-1]}"#,
        r#"{"cmd":"stop"}"#,
        r#"{"cmd":"ping"}"#,
        "{{{{",
    ];
    for other in [Other::Frames, Other::Page] {
        for flood in floods {
            other.check(flood, |world| {
                while world.pages[1].to_send.len() < 300 {
                    world.send_message(1, flood);
                }
            });
        }
    }
}

/// Only the sender's connection knows how old the frames are.
#[test]
fn frames_that_the_hub_has_no_room_for_stay_with_their_sender() {
    let mut world = World::new(1);
    let frame = write(TARGET_POSITION.address, &[120]);
    (0..60).for_each(|_| world.send(0, &frame));
    world.push();
    let taken = 60 - world.programs[0].to_send_bytes() / frame.len();
    assert!((20..=21).contains(&taken), "{taken} frames are taken");
}

/// Without the news the server would not pass on the bytes that wait for room, and the program would wait for ever.
#[test]
fn a_stop_that_makes_room_for_a_program_is_news_for_it() {
    let mut world = World::new(2);
    (0..20).for_each(|_| world.send(0, &write(TARGET_POSITION.address, &[120])));
    world.push();
    assert!(!world.has_news(0));
    world.send(1, &write(MOTOR_STATE.address, &[2]));
    world.push();
    assert!(world.has_news(0));
}

/// The read gets no reply, so all messages wait. Refused commands in a row share one entry of the queue. With stops between
/// them the queue grows until the connection ends.
#[test]
fn a_queue_of_messages_has_an_end() {
    for (flood, is_overrun) in [(r#"{"cmd":"ping"}"#, false), (r#"{"cmd":"stop"}"#, true)] {
        let mut world = World::new(0);
        world.join_page();
        world.loses_replies = true;
        world.send_message(0, READ_MESSAGE);
        for _ in 0..300 {
            world.send_message(0, r#"{"cmd":"ping"}"#);
            world.send_message(0, flood);
        }
        world.run(10);
        assert_eq!(world.pages[0].is_overrun(), is_overrun, "{flood}");
    }
}
