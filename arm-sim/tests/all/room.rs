//! The arm among things: it grips, lifts, stacks, pushes and drops them, and the table stops it.

use arm_sim::request::Request;
use arm_sim::scene::Scene;
use arm_sim::{Action, Duration, Joint, Simulation};
use kinematics::{Vector, ik6};
use motion_core::calibration::MicroDegrees;

/// About the distance from the tip to the middle of the pads in mm, with claws that hold 30 mm.
const PADS: f64 = 59.5;
const BLOCKED_JOINTS: u8 = 195;

/// An arm with a scene, switched on a second ago.
pub struct Room(pub Simulation);

impl Room {
    pub fn new(scene: &str) -> Self {
        let mut arm = Simulation::default();
        arm.plant_mut().set_scene(Some(scene.parse().unwrap()));
        arm.advance(Duration::from_millis(1_000));
        Self(arm)
    }

    /// Moves the tip to this point at the default speed, with the tool straight down.
    #[expect(clippy::cast_possible_truncation, reason = "angles of a pose")]
    fn tip_to(&mut self, x: f64, y: f64, z: f64) {
        let angles = ik6(Vector::new(x, y, z), Vector::new(0.0, 0.0, -1.0)).unwrap();
        let hundredths = angles.map(|degrees| MicroDegrees::nearest(degrees as f32).nearest_centidegree());
        let bytes: Vec<u8> = hundredths.iter().flat_map(|angle| angle.to_le_bytes()).collect();
        self.write(128, &bytes);
    }

    /// Moves the tip along the vertical at x and y from the height `from` to the height `to`, in ten steps.
    fn line(&mut self, [x, y, from]: [f64; 3], to: f64) {
        for step in 1..=10 {
            self.tip_to(x, y, from + (to - from) * f64::from(step) / 10.0);
        }
    }

    fn claws_to(&mut self, degrees: u8) {
        self.write(52, &[degrees]);
    }

    fn write(&mut self, address: u8, values: &[u8]) {
        self.0.send_request(&Request::Write { address, values });
        self.0.advance(Duration::from_millis(2_500));
    }

    /// The blocked joints, one bit each.
    fn blocked(&mut self) -> u8 {
        // The registers of the joints are updated when a host reads them.
        self.0.send_request(&Request::Read { address: BLOCKED_JOINTS, count: 1 });
        self.0.advance(Duration::from_millis(100));
        self.0.registers().get(BLOCKED_JOINTS)
    }

    fn place(&self, name: &str) -> Vector<f64> {
        let world = self.0.plant().world().unwrap();
        world.objects().iter().find(|object| object.item.name == name).unwrap().frame.origin
    }

    fn assert_at(&self, name: &str, [x, y, z]: [f64; 3], within: f64) {
        let place = self.place(name);
        let distance = (place - Vector::new(x, y, z)).length();
        assert!(distance <= within, "{name} is at {place:?}, {distance:.1} mm from {x} {y} {z}");
    }

    /// Grips the object whose middle is at this point, and lifts it.
    pub fn pick(&mut self, x: f64, y: f64, z: f64) {
        self.claws_to(60);
        self.tip_to(x, y, z + PADS + 60.0);
        self.line([x, y, z + PADS + 60.0], z + PADS);
        self.claws_to(10);
        self.line([x, y, z + PADS], z + PADS + 60.0);
    }

    /// Puts the carried object down with its middle at this point, and goes up.
    fn put(&mut self, x: f64, y: f64, z: f64) {
        self.tip_to(x, y, z + PADS + 60.0);
        self.line([x, y, z + PADS + 60.0], z + PADS);
        self.claws_to(60);
        self.line([x, y, z + PADS], z + PADS + 60.0);
    }
}

#[test]
fn a_cube_is_gripped_carried_and_put_down() {
    let mut room = Room::new("cube red 30 40 0 200");
    room.assert_at("red", [0.0, 200.0, -45.0], 0.01);
    room.pick(0.0, 200.0, -45.0);
    room.assert_at("red", [0.0, 200.0, 15.0], 6.0);
    assert_eq!(room.0.plant().load_grams(), 40, "the arm feels its weight");
    room.put(100.0, 180.0, -44.0);
    room.assert_at("red", [100.0, 180.0, -45.0], 6.0);
    assert_eq!(room.0.plant().load_grams(), 0);
    let place = room.place("red");
    room.0.advance(Duration::from_millis(5_000));
    assert_eq!(room.place("red"), place, "it stands");
}

#[test]
fn three_cubes_are_stacked() {
    let mut room = Room::new("cube a 30 40 -90 190; cube b 30 40 0 200; cube c 30 40 90 190");
    room.pick(-90.0, 190.0, -45.0);
    room.put(0.0, 200.0, -14.0);
    room.pick(90.0, 190.0, -45.0);
    room.put(0.0, 200.0, 16.0);
    room.assert_at("b", [0.0, 200.0, -45.0], 6.0);
    room.assert_at("a", [0.0, 200.0, -15.0], 8.0);
    room.assert_at("c", [0.0, 200.0, 15.0], 8.0);
}

#[test]
fn what_is_pressed_on_the_table_and_let_go_stands_on_it() {
    let mut room = Room::new("cube red 30 40 0 200");
    room.pick(0.0, 200.0, -45.0);
    room.put(60.0, 190.0, -52.0);
    room.assert_at("red", [60.0, 190.0, -45.0], 12.0);
    assert!((room.place("red").z + 45.0).abs() < 0.01, "{:?}", room.place("red"));
}

#[test]
fn what_is_dropped_falls_on_what_is_below_it() {
    let mut room = Room::new("wall shelf 0 200 80 80 50; cube red 30 40 0 200");
    room.assert_at("red", [0.0, 200.0, 5.0], 0.01);
    room.pick(0.0, 200.0, 5.0);
    room.tip_to(120.0, 180.0, 110.0);
    room.0.act(Action::Drop);
    room.0.advance(Duration::from_millis(100));
    assert!((-40.0..40.0).contains(&room.place("red").z), "it falls");
    room.0.advance(Duration::from_millis(1_000));
    room.assert_at("red", [120.0, 180.0, -45.0], 8.0);
    assert_eq!(room.0.plant().load_grams(), 0);
}

#[test]
fn a_thing_that_is_pushed_moves_with_what_stands_on_it_and_a_wall_stops_it() {
    let mut room = Room::new(
        "cube low 40 40 0 200; cube high 20 10 0 200; cube next 40 40 -60 200; wall w -130 200 20 80 60",
    );
    room.claws_to(0);
    room.tip_to(60.0, 200.0, 20.0);
    room.tip_to(0.0, 200.0, 20.0);
    let (low, high, next) = (room.place("low"), room.place("high"), room.place("next"));
    assert!(low.x < -20.0, "pushed: {low:?}");
    assert!((high.x - low.x).abs() < 4.0 && high.z > low.z, "it rides: {high:?}");
    assert!(next.x < -61.0, "the next one, too: {next:?}");
    // The base turns further to the left.
    room.write(46, &[150]);
    let (low, next) = (room.place("low"), room.place("next"));
    assert!(next.x > -101.0 && low.x > -62.0, "the wall stops both: {next:?} {low:?}");
    assert_eq!(room.blocked(), 0b1, "so the base is blocked");
}

#[test]
fn the_table_blocks_the_arm_before_a_servo_switches_itself_off() {
    let mut room = Room::new("table -60");
    room.claws_to(0);
    room.tip_to(0.0, 220.0, 40.0);
    room.tip_to(0.0, 220.0, -100.0);
    room.0.advance(Duration::from_millis(4_000));
    assert_ne!(room.blocked(), 0);
    assert!(Joint::ALL.iter().all(|joint| !room.0.plant().is_overloaded(*joint)));
    let claws = room.0.plant().angle(Joint::ALL[2]);
    room.0.plant_mut().set_scene(None);
    room.tip_to(0.0, 220.0, -100.0);
    assert!(room.0.plant().angle(Joint::ALL[2]) > claws + 2_000, "without the table it goes on");
}

#[test]
fn the_cup_carries_while_the_pump_sucks() {
    let mut room = Room::new("tool cup; cylinder can 40 60 100 0 220");
    room.tip_to(0.0, 220.0, 60.0);
    room.tip_to(0.0, 220.0, 25.5);
    room.write(31, &[1]);
    room.tip_to(0.0, 220.0, 80.0);
    room.assert_at("can", [0.0, 220.0, 24.5], 6.0);
    for claw in [10, 80] {
        room.claws_to(claw);
        assert_eq!(room.blocked(), 0, "what hangs on the cup is not between the claws");
    }
    assert_eq!(room.0.plant().load_grams(), 100);
    room.write(31, &[0]);
    room.assert_at("can", [0.0, 220.0, -30.0], 6.0);
    assert_eq!(room.0.plant().load_grams(), 0);
}

#[test]
fn what_is_torn_off_the_cup_falls_and_stays_until_the_pump_was_off() {
    let mut room = Room::new("tool cup; cylinder can 40 60 100 0 220");
    room.tip_to(0.0, 220.0, 60.0);
    room.tip_to(0.0, 220.0, 25.5);
    room.write(31, &[1]);
    assert_eq!(room.0.plant().load_grams(), 100);
    room.0.act(Action::Drop);
    room.0.advance(Duration::from_millis(500));
    assert_eq!(room.0.plant().load_grams(), 0, "the pump runs, and it was torn off");
    room.write(31, &[0]);
    room.write(31, &[1]);
    assert_eq!(room.0.plant().load_grams(), 100);
}

#[test]
fn a_weight_and_a_thing_of_a_person_are_there_beside_the_room() {
    let mut room = Room::new("cube red 30 40 0 200");
    room.0.act(Action::Weight(150));
    room.pick(0.0, 200.0, -45.0);
    assert_eq!(room.0.plant().load_grams(), 190);
    room.0.act(Action::Drop);
    room.0.advance(Duration::from_millis(500));
    assert_eq!(room.0.plant().load_grams(), 0, "all of it falls");
    room.claws_to(80);
    room.0.set_fault("7=thing=50".parse().unwrap(), None);
    room.claws_to(20);
    let claw = room.0.plant().angle(Joint::ALL[6]);
    assert!((49_000..51_000).contains(&claw), "{claw}: the thing is between the claws");
    room.0.plant_mut().set_scene(None);
    assert!(room.0.plant().has_thing(), "it is not of the room");
}

#[test]
fn the_same_calls_move_the_same_things_to_the_bit() {
    let run = || {
        let mut room = Room::new("cube a 30 40 -60 200 20; cube b 30 40 0 200; cylinder c 30 50 30 60 200");
        room.pick(-60.0, 200.0, -45.0);
        room.put(5.0, 205.0, -10.0);
        ["a", "b", "c"].map(|name| room.place(name))
    };
    assert_eq!(run(), run());
    let scene: Scene = "cube a 30 40 -60 200 20".parse().unwrap();
    let mut one = Room::new(&scene.to_string());
    let mut copy = Room(one.0.clone());
    one.pick(-60.0, 200.0, -45.0);
    copy.pick(-60.0, 200.0, -45.0);
    assert_eq!(one.place("a"), copy.place("a"), "a copy is a snapshot");
}
