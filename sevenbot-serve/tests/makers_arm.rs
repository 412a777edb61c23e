//! An arm with the maker's firmware 2.2: it has the registers 0 to 60, and neither hundredths of a degree nor a status.

#![allow(clippy::expect_used, clippy::indexing_slicing, clippy::unwrap_used)] // A panic is a failed test.

use protocol_core::registers::Map;
use protocol_core::registers::map::SET_POINT_PERIOD;
use protocol_core::request::Reply;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;
use sevenbot_serve::Hub;
use sevenbot_serve::hub::{Admission, ClientId, HoldOutcome, HubOptions, WholeRequest};

const SPEEDS: [u8; 7] = [60, 10, 20, 30, 40, 50, 0];
const POSE: [u8; 7] = [81, 82, 83, 84, 85, 86, 87];

/// The arm, the hub, and a client of it.
struct World {
    now: Instant,
    hub: Hub,
    client: ClientId,
    registers: [u8; 256],
    /// The address and the values of each write.
    writes: Vec<(u8, Vec<u8>)>,
    loses_replies: bool,
}

impl World {
    fn new() -> Self {
        let mut hub = Hub::new(115_200, HubOptions::default());
        let client = hub.connect();
        let mut registers = [0; 256];
        (registers[0], registers[1], registers[29]) = (7, 22, 1);
        registers[32..39].copy_from_slice(&SPEEDS);
        registers[46..53].copy_from_slice(&[150; 7]);
        registers[54..61].copy_from_slice(&POSE);
        hub.open_arm(Instant::ZERO);
        let mut world =
            Self { now: Instant::ZERO, hub, client, registers, writes: Vec::new(), loses_replies: false };
        world.run(100);
        assert!(world.hub.has_arm());
        world.writes.clear();
        world
    }

    fn run(&mut self, millis: u64) {
        for _ in 0..millis {
            self.now = self.now + Duration::from_millis(1);
            self.hub.poll(self.now);
            let sent = self.hub.to_arm().to_vec();
            self.hub.sent_to_arm(sent.len());
            self.take(&sent);
        }
    }

    /// Executes frames of the hub, which come whole, as the arm would.
    fn take(&mut self, mut frames: &[u8]) {
        while let [0xAA, 0x77, function, address, count, rest @ ..] = frames {
            let (start, count) = (usize::from(*address), usize::from(*count));
            let data = if *function == 3 { 0 } else { count };
            if *function == 3 && !self.loses_replies {
                let mut reply = FrameBuffer::new();
                let values = &self.registers[start..start + count];
                Reply { address: *address, values }.encode(&mut reply);
                self.hub.arm_bytes(self.now, &reply);
            } else if *function == 6 {
                self.registers[start..start + count].copy_from_slice(&rest[..data]);
                self.writes.push((*address, rest[..data].to_vec()));
            }
            frames = &rest[data + 2..];
        }
        self.hub.arm_bytes(self.now, &[]);
    }
}

#[test]
fn it_is_held_in_whole_degrees_behind_a_brake() {
    let mut world = World::new();
    assert_eq!(world.hub.stop_arm(world.now, world.client), Admission::Queued);
    world.run(50);
    assert_eq!(world.hub.hold_outcome(), Some(HoldOutcome::Holds));
    let expected = [(32, vec![1; 7]), (46, POSE.to_vec()), (32, SPEEDS.to_vec())];
    assert_eq!(world.writes, expected, "no register of the extended block");
}

/// A program writes the set-point period, as it would for an arm with this project's firmware.
#[test]
fn it_has_no_period_that_a_hold_restores() {
    let mut world = World::new();
    let period =
        WholeRequest::Write { map: Map::V22, address: SET_POINT_PERIOD.address, values: vec![20, 0] };
    world.hub.request(world.now, world.client, world.now, period);
    world.run(50);
    world.writes.clear();
    world.registers[usize::from(SET_POINT_PERIOD.address)] = 0;
    world.hub.stop_arm(world.now, world.client);
    world.run(50);
    assert_eq!(world.hub.hold_outcome(), Some(HoldOutcome::Holds));
    let expected = [(32, vec![1; 7]), (46, POSE.to_vec()), (32, SPEEDS.to_vec())];
    assert_eq!(world.writes, expected, "no register of the extended block");
}

#[test]
fn it_is_slowed_down_although_no_reply_comes() {
    let mut world = World::new();
    world.loses_replies = true;
    world.hub.stop_arm(world.now, world.client);
    world.run(1_000);
    assert!((9..=11).contains(&world.writes.len()), "{:?}", world.writes);
    assert!(world.writes.iter().all(|write| *write == (32, vec![1; 7])), "{:?}", world.writes);
    world.loses_replies = false;
    world.run(300);
    assert_eq!((&world.registers[46..53], &world.registers[32..39]), (&POSE[..], &SPEEDS[..]));
}
