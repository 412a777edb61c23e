//! The loop of a shell: delivers bytes, polls until the controller waits, and sleeps, in virtual time.

use motion_core::{Config, Controller, Output, Storage};
use protocol_core::registers::Image;
use protocol_core::time::Instant;
use protocol_core::wire::MAX_LENGTH;

use super::invariants::InvariantChecker;
use super::scripted_replies::{ScriptedReplies, decode};

/// The latest time in microseconds, about 146,000 years. Later deadlines would overflow.
const END_OF_TIME_US: u64 = 1 << 62;

pub struct ControllerLoop {
    pub controller: Controller,
    pub replies: ScriptedReplies,
    /// The free space of the host link in bytes.
    pub room: usize,
    pub next_save: Storage,
    now_us: u64,
    /// The next time at which the controller wants to be polled.
    wake_at: Instant,
    /// Host bytes that the controller has not taken yet.
    waiting: Vec<u8>,
    checker: InvariantChecker,
}

impl ControllerLoop {
    pub fn new(config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        let controller = Controller::new(Instant::ZERO, config, stored, storage);
        let checker = InvariantChecker::new(config, storage, controller.registers());
        Self {
            controller,
            replies: ScriptedReplies::new(),
            room: 4_096,
            next_save: Storage::Ready,
            now_us: 0,
            wake_at: Instant::ZERO,
            waiting: Vec::new(),
            checker,
        }
    }

    pub fn pass(&mut self, micros: u64) {
        self.now_us = self.now_us.saturating_add(micros).min(END_OF_TIME_US.max(self.now_us));
    }

    pub fn receive(&mut self, bytes: &[u8]) {
        self.waiting.extend(bytes);
    }

    /// Sleeps until the deadline and runs the loop, `count` times.
    pub fn run(&mut self, count: usize) {
        for _ in 0..count {
            self.now_us = self.now_us.max(self.wake_at.as_micros());
            self.run_once();
        }
    }

    /// Delivers bytes of the servo bus.
    pub fn servo_bytes(&mut self, bytes: &[u8]) {
        self.controller.servo_bytes(Instant::from_micros(self.now_us), bytes);
    }

    /// Runs the loop until the controller waits. Panics if it does not wait after a bounded number of polls.
    pub fn run_once(&mut self) {
        // Every frame may need a poll, and so may every byte behind a false header.
        let max_polls = 100 + self.waiting.len();
        for _ in 0..max_polls {
            let silent = self.waiting.is_empty();
            let taken = self.controller.host_bytes(Instant::from_micros(self.now_us), &self.waiting);
            self.waiting.drain(..taken);
            let Some(wake_at) = self.poll() else { continue };
            // Without room for a reply, a request waits, and so do the bytes behind it.
            let stuck = self.room < MAX_LENGTH && taken == 0;
            if wake_at.as_micros() > self.now_us && (silent || stuck) {
                self.wake_at = wake_at;
                return;
            }
        }
        panic!("no wait after {max_polls} polls");
    }

    /// Polls once. Returns the deadline if the controller waits.
    fn poll(&mut self) -> Option<Instant> {
        let now = Instant::from_micros(self.now_us);
        match self.controller.poll(now, self.room) {
            Output::ToHost(bytes) => {
                assert!(bytes.len() <= self.room);
                let bytes = bytes.to_vec();
                self.checker.frame_to_host(&bytes, self.controller.registers());
            }
            Output::ToServos(bytes) => {
                let command = decode(bytes);
                self.checker.command_to_servos(
                    self.now_us,
                    &command,
                    self.controller.registers(),
                    &self.replies.reported_positions,
                );
                if let Some(answer) = self.replies.execute(&command) {
                    self.controller.servo_bytes(now, &answer);
                }
            }
            Output::Vacuum(vacuum) => self.checker.vacuum_switched(self.now_us, vacuum),
            Output::Save(image) => {
                assert_eq!(image, self.controller.registers().image());
                self.controller.set_storage(self.next_save);
                self.checker.saved(image, self.next_save);
            }
            Output::Wait(until) => {
                self.checker.after_wait(self.now_us, self.controller.registers());
                return Some(until);
            }
        }
        self.checker.after_poll(self.controller.registers());
        None
    }

    /// Empties the host link and runs the loop 40 times without new bytes. Panics if host bytes still wait, or if a setting is
    /// not saved.
    pub fn finish(&mut self) {
        self.room = 4_096;
        self.run(40);
        assert!(self.waiting.is_empty());
        assert!(self.controller.registers().image() == self.checker.settings, "an unsaved setting");
    }
}
