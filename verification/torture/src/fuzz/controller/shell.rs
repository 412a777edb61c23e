//! A shell as firmware and simulator have one: hands over what came, polls until there is nothing to do, and
//! sleeps until there is. Time is a number.

use motion_core::{Config, Controller, Output, Storage};
use protocol_core::registers::Image;
use protocol_core::time::Instant;
use protocol_core::wire::MAX_LENGTH;

use super::servos::{Servos, decode};
use super::watch::Watch;

/// A hundred thousand years: past that, deadlines run into the end of the numbers.
const END_OF_TIME_US: u64 = 1 << 62;

pub struct Shell {
    pub controller: Controller,
    pub servos: Servos,
    /// How many bytes the host takes at once.
    pub room: usize,
    pub next_save: Storage,
    now_us: u64,
    /// When the controller wants to be polled again.
    due: Instant,
    /// What the host sent and the controller has not taken yet.
    waiting: Vec<u8>,
    watch: Watch,
}

impl Shell {
    pub fn new(config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        let controller = Controller::new(Instant::ZERO, config, stored, storage);
        let watch = Watch::new(config, storage, controller.registers());
        Self {
            controller,
            servos: Servos::new(),
            room: 4_096,
            next_save: Storage::Ready,
            now_us: 0,
            due: Instant::ZERO,
            waiting: Vec::new(),
            watch,
        }
    }

    pub fn pass(&mut self, micros: u64) {
        self.now_us = self.now_us.saturating_add(micros).min(END_OF_TIME_US.max(self.now_us));
    }

    pub fn hear(&mut self, bytes: &[u8]) {
        self.waiting.extend(bytes);
    }

    /// Sleeps as the controller wishes, then turns; so often.
    pub fn turns(&mut self, count: usize) {
        for _ in 0..count {
            self.now_us = self.now_us.max(self.due.as_micros());
            self.turn();
        }
    }

    /// Bytes come over the servo bus, whoever sent them.
    pub fn servo_bytes(&mut self, bytes: &[u8]) {
        self.controller.servo_bytes(Instant::from_micros(self.now_us), bytes);
    }

    /// All that can be done now is done in a bounded number of calls.
    pub fn turn(&mut self) {
        // Every frame may take a call, and every byte of a header that proves wrong be looked at again.
        let most_calls = 100 + self.waiting.len();
        for _ in 0..most_calls {
            let silent = self.waiting.is_empty();
            let taken = self.controller.host_bytes(Instant::from_micros(self.now_us), &self.waiting);
            self.waiting.drain(..taken);
            let Some(due) = self.poll() else { continue };
            // With no room for an answer, requests wait, and whatever is behind them.
            let stuck = self.room < MAX_LENGTH && taken == 0;
            if due.as_micros() > self.now_us && (silent || stuck) {
                self.due = due;
                return;
            }
        }
        panic!("no end after {most_calls} calls");
    }

    /// One call, and what it asks for; the deadline if it asks for nothing.
    fn poll(&mut self) -> Option<Instant> {
        let now = Instant::from_micros(self.now_us);
        match self.controller.poll(now, self.room) {
            Output::ToHost(bytes) => {
                assert!(bytes.len() <= self.room);
                let bytes = bytes.to_vec();
                self.watch.told_host(&bytes, self.controller.registers());
            }
            Output::ToServos(bytes) => {
                let command = decode(bytes);
                self.watch.told_servos(self.now_us, &command, self.controller.registers(), &self.servos.told);
                if let Some(answer) = self.servos.take(&command) {
                    self.controller.servo_bytes(now, &answer);
                }
            }
            Output::Vacuum(vacuum) => self.watch.switched(self.now_us, vacuum),
            Output::Save(image) => {
                assert_eq!(image, self.controller.registers().image());
                self.controller.set_storage(self.next_save);
                self.watch.saved(image, self.next_save);
            }
            Output::Wait(until) => {
                self.watch.idle(self.now_us, self.controller.registers());
                return Some(until);
            }
        }
        self.watch.polled(self.controller.registers());
        None
    }

    /// With the host silent and its link empty, whatever was waiting is carried out and the arm lives on.
    pub fn end(&mut self) {
        self.room = 4_096;
        self.turns(40);
        assert!(self.waiting.is_empty());
        assert!(self.controller.registers().image() == self.watch.settings, "a setting that nobody saved");
    }
}
