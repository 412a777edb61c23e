//! Clients, a hub and a simulated arm on a line of 115 200 baud, in virtual time.

#![allow(dead_code)] // Each test file uses a part of the rig.

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::servo_bus::TorqueCodes;
use protocol_core::request::{Reply, ReportMap21, Request};
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::{Deframer, FrameBuffer, ToHost};
use sevenbot_serve::hub::HubOptions;
use sevenbot_serve::{FrameClient, Hub, MakerClient};

use std::collections::VecDeque;

pub const BAUD: u32 = 115_200;

/// A frame that a client received: address and values.
pub type Received = (u8, Vec<u8>);

/// A program: the bytes that it still has to send, and what it received.
pub struct Program {
    client: FrameClient,
    to_send: Vec<u8>,
    deframer: Deframer<ToHost>,
    pub received: Vec<(Instant, Received)>,
    /// Reports of map 2.1.
    pub reports: Vec<Received>,
    /// The program takes the bytes that the server has for it.
    pub reads: bool,
}

/// A page at the maker's WebSocket.
pub struct Page {
    client: MakerClient,
    /// Messages that it still has to send.
    pub to_send: VecDeque<String>,
    pub answers: Vec<(Instant, String)>,
}

pub struct World {
    pub now: Instant,
    pub hub: Hub,
    pub arm: SimulatedArm<Flash>,
    pub is_plugged: bool,
    /// What the hub sent, for tests that look at it.
    pub sent: Vec<u8>,
    /// The next byte of the arm is damaged on the line.
    pub damages_next_byte: bool,
    /// The arm's bytes are lost on the line.
    pub loses_replies: bool,
    /// Bytes to the arm are lost on the line.
    pub loses_requests: bool,
    /// A frame to the arm, and how many times it is damaged on the line.
    pub damaged_frame: (Vec<u8>, usize),
    pub programs: Vec<Program>,
    pub pages: Vec<Page>,
}

pub fn read(address: u8, count: u8) -> Vec<u8> {
    encode(&Request::Read { address, count })
}

pub fn write(address: u8, values: &[u8]) -> Vec<u8> {
    encode(&Request::Write { address, values })
}

pub fn write_map21(address: u8, values: &[u8]) -> Vec<u8> {
    encode(&Request::WriteMap21 { address, values })
}

fn encode(request: &Request<'_>) -> Vec<u8> {
    let mut frame = FrameBuffer::new();
    request.encode(&mut frame);
    frame.to_vec()
}

fn powered_up(now: Instant) -> SimulatedArm<Flash, Plant> {
    let config = ArmConfig { chip_id: *b"SIM\0\0\x01", is_paced: true, torque_codes: TorqueCodes::default() };
    SimulatedArm::new(now, config, Flash::in_memory(), Plant::new(now))
}

impl World {
    /// An arm that has started up, and programs that have sent nothing.
    pub fn new(programs: usize) -> Self {
        Self::with_access(programs, false)
    }

    pub fn with_access(programs: usize, is_read_only: bool) -> Self {
        Self::with_options(programs, HubOptions { is_read_only, ..HubOptions::default() })
    }

    pub fn with_options(programs: usize, options: HubOptions) -> Self {
        let arm = powered_up(Instant::ZERO);
        let hub = Hub::new(BAUD, options);
        let mut world = Self {
            now: Instant::ZERO,
            hub,
            arm,
            is_plugged: false,
            sent: Vec::new(),
            damages_next_byte: false,
            loses_replies: false,
            loses_requests: false,
            damaged_frame: (Vec::new(), 0),
            programs: Vec::new(),
            pages: Vec::new(),
        };
        world.plug();
        (0..programs).for_each(|_| world.join());
        world.run(1_000);
        assert!(world.hub.has_arm());
        world
    }

    pub fn join(&mut self) {
        let client = FrameClient::connect(&mut self.hub, BAUD);
        let deframer = Deframer::new(Duration::from_millis(2));
        let program = Program {
            client,
            to_send: Vec::new(),
            deframer,
            received: Vec::new(),
            reports: Vec::new(),
            reads: true,
        };
        self.programs.push(program);
    }

    pub fn join_page(&mut self) {
        let client = MakerClient::connect(&mut self.hub, true);
        self.pages.push(Page { client, to_send: VecDeque::new(), answers: Vec::new() });
    }

    pub fn send_message(&mut self, page: usize, message: &str) {
        self.pages[page].to_send.push_back(message.to_owned());
    }

    /// Has the hub something new for the program since the last call?
    pub fn has_news(&mut self, program: usize) -> bool {
        self.hub.take_news().contains(&self.programs[program].client.id())
    }

    pub fn leave(&mut self, number: usize) {
        self.hub.leave(self.now, self.programs.remove(number).client.id());
    }

    /// The program's connection is reset.
    pub fn reset(&mut self, number: usize) {
        self.hub.disconnect(self.now, self.programs.remove(number).client.id());
    }

    pub fn plug(&mut self) {
        self.is_plugged = true;
        self.hub.open_arm(self.now);
    }

    /// The arm is switched off and on while it is plugged in.
    pub fn power_cycle(&mut self) {
        self.arm = powered_up(self.now);
    }

    pub fn unplug(&mut self) {
        self.is_plugged = false;
        self.arm.host_disconnect();
        self.hub.close_arm();
    }

    pub fn send(&mut self, program: usize, bytes: &[u8]) {
        self.programs[program].to_send.extend(bytes);
    }

    /// Runs for some milliseconds, in steps of 0.1 ms.
    pub fn run(&mut self, millis: u64) {
        self.advance(millis * 10);
    }

    /// Runs for some steps of 0.1 ms.
    pub fn advance(&mut self, steps: u64) {
        for _ in 0..steps {
            self.now = self.now + Duration::from_micros(100);
            self.step();
        }
    }

    /// Hands over what the programs sent, and nothing else.
    pub fn push(&mut self) {
        for program in &mut self.programs {
            let taken = program.client.push(&mut self.hub, self.now, self.now, &program.to_send);
            program.to_send.drain(..taken);
        }
    }

    fn step(&mut self) {
        self.push();
        for page in &mut self.pages {
            page.send(&mut self.hub, self.now);
        }
        self.hub.poll(self.now);
        if self.is_plugged {
            let request = self.damaged_request();
            let room = self.arm.host_room().min(request.len());
            let sent = match self.loses_requests {
                true => room,
                false => self.arm.host_send(self.now, &request[..room]),
            };
            self.sent.extend(&request[..sent]);
            self.hub.sent_to_arm(sent);
            self.arm.advance(self.now, true);
            let mut received = self.arm.host_received().to_vec();
            self.arm.host_take(received.len());
            if let Some(byte) = received.first_mut().filter(|_| self.damages_next_byte) {
                *byte ^= 0xFF;
                self.damages_next_byte = false;
            }
            if self.loses_replies {
                received.clear();
            }
            self.hub.arm_bytes(self.now, &received);
        }
        for program in &mut self.programs {
            program.client.collect(&mut self.hub);
            if program.reads {
                program.take(self.now);
            }
        }
        for page in &mut self.pages {
            page.take(&mut self.hub, self.now);
        }
    }

    /// The bytes of the hub up to the next frame that is damaged, or that frame with a wrong checksum.
    fn damaged_request(&mut self) -> Vec<u8> {
        let mut bytes = self.hub.to_arm().to_vec();
        let (frame, times) = &mut self.damaged_frame;
        let start =
            bytes.windows(frame.len().max(1)).position(|window| window == frame).filter(|_| *times > 0);
        match start {
            Some(0) if self.arm.host_room() >= frame.len() => {
                *times -= 1;
                bytes.truncate(frame.len());
                bytes[frame.len() - 1] ^= 0xFF;
            }
            Some(start) => bytes.truncate(start),
            None => {}
        }
        bytes
    }

    /// What a program received since the last call.
    pub fn take(&mut self, program: usize) -> Vec<Received> {
        self.programs[program].received.drain(..).map(|(_, received)| received).collect()
    }

    /// Sends a request of a program and returns the time until its reply.
    pub fn round_trip(&mut self, program: usize, request: &[u8]) -> Duration {
        self.programs[program].received.clear();
        self.send(program, request);
        let start = self.now;
        // A report is no reply.
        let is_reply = |(_, (address, values)): &&(Instant, Received)| {
            *address == request[3] && values.len() == usize::from(request[4])
        };
        loop {
            if let Some((at, _)) = self.programs[program].received.iter().find(is_reply) {
                return *at - start;
            }
            self.run(1);
            assert!(self.now - start < Duration::from_millis(5_000), "no reply");
        }
    }
}

impl World {
    /// Sends a message of a page and returns the time until its answer.
    pub fn page_round_trip(&mut self, page: usize, message: &str) -> Duration {
        self.pages[page].answers.clear();
        self.send_message(page, message);
        let start = self.now;
        while self.pages[page].answers.is_empty() {
            self.run(1);
            assert!(self.now - start < Duration::from_millis(5_000), "no answer");
        }
        self.pages[page].answers[0].0 - start
    }
}

impl Page {
    /// Would the server end the connection?
    pub fn is_overrun(&self) -> bool {
        self.client.is_overrun()
    }

    /// Passes at most 20 messages to the client.
    fn send(&mut self, hub: &mut Hub, now: Instant) {
        for _ in 0..20 {
            let Some(message) = self.to_send.pop_front_if(|_| !self.client.is_overrun()) else { break };
            self.client.message(now, &message);
        }
        self.client.advance(hub, now);
    }

    fn take(&mut self, hub: &mut Hub, now: Instant) {
        loop {
            self.client.advance(hub, now);
            let Some(answer) = self.client.take_answer() else { return };
            self.answers.push((now, answer));
        }
    }
}

impl Program {
    pub fn is_waiting(&self) -> bool {
        !self.to_send.is_empty()
    }

    pub fn to_send_bytes(&self) -> usize {
        self.to_send.len()
    }

    /// Bytes that the program has not taken.
    pub fn unread_bytes(&self) -> usize {
        self.client.output().len()
    }

    fn take(&mut self, now: Instant) {
        let bytes = self.client.output().to_vec();
        self.client.consume(bytes.len());
        let mut rest = bytes.as_slice();
        loop {
            rest = &rest[self.deframer.push(now, rest)..];
            while let Some(frame) = self.deframer.pull() {
                let frame = frame.expect("whole frames");
                if let Some(report) = ReportMap21::from_frame(frame) {
                    self.reports.push((report.address, report.values.to_vec()));
                    continue;
                }
                let reply = Reply::from_frame(frame).expect("a reply");
                self.received.push((now, (reply.address, reply.values.to_vec())));
            }
            if rest.is_empty() {
                return;
            }
        }
    }
}

/// The registers of the server: the first one, and how many.
pub const SHARING: (u8, u8) = (232, 8);

/// The values of the registers of [`SHARING`], as a program reads them.
pub fn sharing(world: &mut World, program: usize) -> Vec<u8> {
    world.take(program);
    world.send(program, &read(SHARING.0, SHARING.1));
    world.run(30);
    let reply = world.take(program).into_iter().find(|(address, _)| *address == SHARING.0);
    reply.expect("a reply").1
}
