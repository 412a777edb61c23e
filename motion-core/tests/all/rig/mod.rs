//! A controller between simulated servos and a host that sends literal bytes, in virtual time.

use arm_sim::plant::Plant;
use motion_core::servo_bus::frame::{Decoder, Instruction, register};
use motion_core::{Config, Controller, Output, Storage, TorqueCodes, Vacuum};
use protocol_core::registers::{Image, Joint};
use protocol_core::time::{Duration, Instant};

const CRC: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);
pub const STANDARD_POSE: [u8; 7] = [90, 90, 65, 90, 90, 90, 80];
/// [`STANDARD_POSE`] in servo counts.
pub const STANDARD_COUNTS: [u16; 7] = [511, 445, 684, 511, 512, 512, 1008];

/// A decoded frame for the servos.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ToServos {
    Ask(u8),
    /// The code for each joint that is named.
    Torque([Option<u8>; 7]),
    /// Id and counts.
    Goals(Vec<(u8, u16)>),
}

pub struct Rig {
    pub now_us: u64,
    pub controller: Controller,
    pub plant: Plant,
    /// How many bytes the host link takes at once.
    pub room: usize,
    pub to_host: Vec<(u64, Vec<u8>)>,
    pub to_servos: Vec<(u64, ToServos)>,
    /// Time and id of each question that asks for the torque switch of a servo.
    pub torque_questions: Vec<(u64, u8)>,
    pub vacuum: Vec<(u64, Vacuum)>,
    pub saved: Vec<Image>,
    /// The state of the storage after the next save.
    pub storage: Storage,
    /// The id of a servo, and how many of the next frames with a goal for it are lost.
    pub lost_goals: (u8, usize),
    /// True if a servo without torque does not show its goal.
    pub hides_goals: bool,
    /// The last goal that reached each servo.
    servo_goals: [Option<u16>; 7],
    /// Each servo that was given torque, with the goal that had reached it and its position.
    pub given_torque: Vec<(u8, Option<u16>, u16)>,
}

pub fn config() -> Config {
    Config {
        chip_id: [1, 2, 3, 4, 5, 6],
        faults: 0,
        servo_baud: 1_000_000,
        servo_timeout: Duration::from_millis(3),
        guard_time: Duration::from_micros(100),
        torque_codes: TorqueCodes::default(),
    }
}

impl Rig {
    /// An arm at the moment of power-up.
    pub fn new() -> Self {
        Self::with(Plant::new(Instant::ZERO), None, Storage::Ready)
    }

    pub fn with(plant: Plant, stored: Option<&Image>, storage: Storage) -> Self {
        Self {
            now_us: 0,
            controller: Controller::new(Instant::ZERO, config(), stored, storage),
            plant,
            room: 4_096,
            to_host: Vec::new(),
            to_servos: Vec::new(),
            torque_questions: Vec::new(),
            vacuum: Vec::new(),
            saved: Vec::new(),
            storage: Storage::Ready,
            lost_goals: (0, 0),
            hides_goals: false,
            servo_goals: [None; 7],
            given_torque: Vec::new(),
        }
    }

    /// An arm one second after power-up.
    pub fn started() -> Self {
        let mut rig = Self::new();
        rig.run_ms(1_000);
        rig.forget();
        rig
    }

    /// As [`Self::started`], without torque and on a stand: each joint is exactly in the standard pose. With torque, the level
    /// forearm droops by 0.6 degrees.
    pub fn on_a_stand() -> Self {
        let mut rig = Self::new();
        rig.plant.support(true);
        rig.write(29, &[2]);
        rig.run_ms(1_000);
        rig.forget();
        rig
    }

    /// Restarts the controller and nothing else: the servos keep their power, their torque and their goals.
    pub fn restart_controller(&mut self) {
        self.controller = Controller::new(self.now(), config(), None, Storage::Ready);
    }

    /// Forgets the recorded frames and vacuum outputs. Saved images and [`Rig::given_torque`] are kept.
    pub fn forget(&mut self) {
        self.to_host.clear();
        self.to_servos.clear();
        self.torque_questions.clear();
        self.vacuum.clear();
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    /// Lets `millis` of virtual time pass.
    pub fn run_ms(&mut self, millis: u64) {
        self.run_us(millis * 1_000);
    }

    /// Lets `micros` of virtual time pass.
    pub fn run_us(&mut self, micros: u64) {
        let end = self.now_us + micros;
        loop {
            let next = self.turn();
            if self.now_us >= end {
                break;
            }
            self.now_us = next.max(self.now_us + 1).min(end);
        }
    }

    /// Runs one turn of the shell's loop. Returns when the next turn is due, in microseconds.
    fn turn(&mut self) -> u64 {
        let now = self.now();
        self.controller.host_bytes(now, &[]);
        let mut answer = self.plant.poll(now).to_vec();
        if self.hides_goals {
            hide_goal(&mut answer);
        }
        self.controller.servo_bytes(now, &answer);
        loop {
            match self.controller.poll(now, self.room) {
                Output::ToHost(bytes) => self.to_host.push((self.now_us, bytes.to_vec())),
                Output::ToServos(bytes) => {
                    let told = decode(bytes);
                    let bytes = bytes.to_vec();
                    if let (ToServos::Ask(id), Some(&register::TORQUE_SWITCH)) = (&told, bytes.get(5)) {
                        self.torque_questions.push((self.now_us, *id));
                    }
                    if self.arrives(&told) {
                        self.plant.bytes(now, &bytes);
                    }
                    self.to_servos.push((self.now_us, told));
                }
                Output::Vacuum(vacuum) => self.vacuum.push((self.now_us, vacuum)),
                Output::Save(image) => {
                    self.saved.push(image);
                    self.controller.set_storage(self.storage);
                }
                Output::Wait(until) => {
                    let servos = self.plant.deadline().unwrap_or(Instant::FAR_FUTURE);
                    return until.min(servos).as_micros();
                }
            }
        }
    }

    /// Does a frame reach the servos? If it does, records its goals, and each servo that it gives torque.
    fn arrives(&mut self, told: &ToServos) -> bool {
        match told {
            ToServos::Goals(goals) => {
                let (lost_id, left) = &mut self.lost_goals;
                if *left > 0 && goals.iter().any(|(id, _)| id == lost_id) {
                    *left -= 1;
                    return false;
                }
                goals.iter().for_each(|&(id, counts)| self.servo_goals[usize::from(id)] = Some(counts));
            }
            ToServos::Torque(codes) => {
                for (joint, code) in Joint::ALL.into_iter().zip(codes) {
                    if *code == Some(1) && !self.plant.has_torque(joint) {
                        let goal = self.servo_goals[usize::from(joint.index())];
                        self.given_torque.push((joint.index(), goal, self.plant.position_counts(joint)));
                    }
                }
            }
            ToServos::Ask(_) => {}
        }
        true
    }

    /// Passes bytes to the controller and lets it act on them. No time passes.
    pub fn send(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.controller.host_bytes(self.now(), rest);
            rest = &rest[taken..];
            self.turn();
        }
    }

    pub fn write(&mut self, address: u8, values: &[u8]) {
        self.send(&write(address, values));
    }

    /// Reads registers over the wire and returns their values.
    pub fn read(&mut self, address: u8, count: u8) -> Vec<u8> {
        let before = self.to_host.len();
        self.send(&frame(3, address, count, &[]));
        let answers: Vec<_> = self.to_host.split_off(before);
        let bytes = &answers.first().expect("an answer").1;
        assert_eq!(*bytes, reply(address, &bytes[5..bytes.len() - 2]), "a whole reply");
        bytes[5..bytes.len() - 2].to_vec()
    }

    pub fn get(&mut self, address: u8) -> u8 {
        self.read(address, 1)[0]
    }

    pub fn counter(&mut self, address: u8) -> u16 {
        let bytes = self.read(address, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    }

    pub fn present(&mut self) -> Vec<u8> {
        self.read(54, 7)
    }

    /// Checks that the joints are at these degrees. Droop and static friction hold a joint up to a degree off its target.
    pub fn assert_at(&mut self, degrees: [u8; 7], why: impl std::fmt::Debug) {
        let present = self.present();
        let is_near = present.iter().zip(degrees).all(|(&is, wanted)| is.abs_diff(wanted) <= 1);
        assert!(is_near, "{present:?}, not {degrees:?}: {why:?}");
    }

    pub fn targets(&mut self) -> Vec<u8> {
        self.read(46, 7)
    }

    /// Runs until no joint moves, and returns how many milliseconds that took.
    pub fn run_until_still(&mut self) -> u64 {
        let start = self.now_us;
        while self.controller.registers().get(243) != 0 {
            self.run_ms(1);
            assert!(self.now_us - start < 60_000_000, "the arm never stands still");
        }
        (self.now_us - start) / 1_000
    }

    pub fn goals(&self) -> impl Iterator<Item = (u64, &Vec<(u8, u16)>)> {
        self.to_servos.iter().filter_map(|(at, told)| match told {
            ToServos::Goals(goals) => Some((*at, goals)),
            _ => None,
        })
    }

    pub fn torques(&self) -> impl Iterator<Item = [Option<u8>; 7]> {
        self.to_servos.iter().filter_map(|(_, told)| match told {
            ToServos::Torque(torque) => Some(*torque),
            _ => None,
        })
    }

    /// Turns a joint by hand, to a servo position.
    pub fn hand(&mut self, joint: u8, counts: u16) {
        self.plant.move_by_hand(Joint::new(joint).expect("1 to 7"), counts);
    }
}

pub fn frame(function: u8, address: u8, count: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xAA, 0x77, function, address, count];
    bytes.extend(data);
    bytes.extend(CRC.checksum(&bytes).to_le_bytes());
    bytes
}

pub fn write(address: u8, values: &[u8]) -> Vec<u8> {
    frame(6, address, u8::try_from(values.len()).expect("at most 255"), values)
}

pub fn reply(address: u8, values: &[u8]) -> Vec<u8> {
    frame(3, address, u8::try_from(values.len()).expect("at most 255"), values)
}

/// Sets the goal to 0 in an answer that begins with the torque switch, if torque is off.
fn hide_goal(answer: &mut [u8]) {
    if let [_, _, _, length, _, torque, _, high, low, .., checksum] = answer
        && *length >= 24
        && *torque != 1
    {
        *checksum = checksum.wrapping_add(*high).wrapping_add(*low);
        (*high, *low) = (0, 0);
    }
}

fn decode(bytes: &[u8]) -> ToServos {
    let mut decoder = Decoder::new();
    decoder.push(bytes);
    let frame = decoder.pull().expect("a whole frame").expect("a right checksum");
    match (Instruction::from_code(frame.code), frame.params) {
        (
            Some(Instruction::Read),
            [register::PRESENT_POSITION, 8..=11] | [register::TORQUE_SWITCH, 24..=27],
        ) => ToServos::Ask(frame.id),
        (Some(Instruction::SyncWrite), [register::TORQUE_SWITCH, 1, items @ ..]) => {
            let mut codes = [None; 7];
            items.chunks_exact(2).for_each(|item| codes[usize::from(item[0])] = Some(item[1]));
            ToServos::Torque(codes)
        }
        (Some(Instruction::SyncWrite), [register::GOAL_POSITION, 6, items @ ..]) => {
            let item = |item: &[u8]| (item[0], u16::from_be_bytes([item[1], item[2]]));
            ToServos::Goals(items.chunks_exact(7).map(item).collect())
        }
        other => panic!("the controller said {other:?}"),
    }
}
