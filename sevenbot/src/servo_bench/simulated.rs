//! Servos without a wire, for tests: the servo's end of `motion-core` behind a [`Line`]. Time is a number.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use motion_core::servo_bus::Reading;
use motion_core::servo_bus::frame::{Decoder, FrameBuffer};
use motion_core::servo_bus::servo::Servo;

use super::bus::{BusOptions, ServoBus};
use super::error::ServoError;
use super::line::Line;
use crate::error::PortError;

/// One servo, and what is wrong with it.
pub(super) struct Simulated {
    pub(super) servo: Servo,
    /// How long an answer takes.
    pub(super) delay: Duration,
    /// Its answers have a wrong checksum.
    pub(super) is_garbled: bool,
    /// It does not turn.
    pub(super) is_stuck: bool,
    /// It answers nothing from this time on.
    pub(super) dies_at: Duration,
    pub(super) position: u16,
}

impl Simulated {
    pub(super) fn new(id: u8) -> Self {
        let delay = Duration::from_micros(250);
        let (is_garbled, is_stuck, dies_at) = (false, false, Duration::MAX);
        Self { servo: Servo::new(id), delay, is_garbled, is_stuck, dies_at, position: 300 }
    }

    /// One count nearer to the goal, or a load that says that something is in the way.
    fn turn(&mut self) {
        let goal = self.servo.goal().position_counts;
        let is_on = self.servo.torque_switch() == 1;
        let is_driven = is_on && goal != self.position;
        if is_driven && !self.is_stuck {
            self.position = if goal > self.position { self.position + 1 } else { self.position - 1 };
        }
        let load = if is_driven && self.is_stuck { 900 } else { 20 };
        let position_counts = self.position;
        let reading =
            Reading { position_counts, speed: 0, load, voltage_decivolts: 74, temperature_celsius: 31 };
        self.servo.set_reading(&reading);
        self.servo.set_moving(is_driven);
    }

    fn hear(&mut self, now: Duration, bytes: &[u8]) -> Option<FrameBuffer> {
        let mut decoder = Decoder::new();
        decoder.push(bytes);
        let frame = decoder.pull()?.ok()?;
        self.turn();
        let mut answer = self.servo.handle_frame(&frame)?;
        if self.is_garbled
            && let Some(sum) = answer.last_mut()
        {
            *sum ^= 0x55;
        }
        (now < self.dies_at).then_some(answer)
    }
}

/// What the test sees of the world while the bus is in use.
#[derive(Default)]
pub(super) struct World {
    pub(super) servos: Vec<Simulated>,
    pub(super) has_echo: bool,
    /// How long an echo takes.
    pub(super) echo_delay: Duration,
    /// The port is gone once so many frames were sent.
    pub(super) frames_until_lost: Option<usize>,
    /// Rates that the adapter knows; empty: all.
    pub(super) rates: Vec<u32>,
    baud: u32,
    now: Duration,
    /// When each piece is through, in this order.
    on_its_way: VecDeque<(Duration, Vec<u8>)>,
    /// Everything that was sent.
    pub(super) sent: Vec<Vec<u8>>,
}

/// The line to the servos of a world.
pub(super) struct Wire(pub(super) Rc<RefCell<World>>);

impl Line for Wire {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let world = &mut *self.0.borrow_mut();
        let now = world.now;
        if world.frames_until_lost.is_some_and(|frames| world.sent.len() >= frames) {
            return Err(PortError::Lost(std::io::ErrorKind::BrokenPipe));
        }
        world.sent.push(bytes.to_vec());
        if world.has_echo {
            world.on_its_way.push_back((now + world.echo_delay, bytes.to_vec()));
        }
        for servo in world.servos.iter_mut().filter(|servo| servo.servo.baud() == world.baud) {
            if let Some(answer) = servo.hear(now, bytes) {
                world.on_its_way.push_back((now + servo.delay, answer.to_vec()));
            }
        }
        world.on_its_way.make_contiguous().sort_by_key(|(at, _)| *at);
        Ok(())
    }

    fn receive(&mut self, patience: Duration) -> Result<Vec<u8>, PortError> {
        let world = &mut *self.0.borrow_mut();
        let deadline = world.now + patience;
        match world.on_its_way.pop_front_if(|(at, _)| *at <= deadline) {
            Some((at, bytes)) => {
                world.now = world.now.max(at);
                Ok(bytes)
            }
            None => {
                world.now = deadline;
                Ok(Vec::new())
            }
        }
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), ServoError> {
        let world = &mut *self.0.borrow_mut();
        if !world.rates.is_empty() && !world.rates.contains(&baud) {
            return Err(ServoError::NoSuchRate { baud });
        }
        world.baud = baud;
        Ok(())
    }

    fn now(&self) -> Duration {
        self.0.borrow().now
    }
}

/// A bus with these servos on it, at 1 Mbaud.
pub(super) fn bus(servos: Vec<Simulated>) -> (ServoBus, Rc<RefCell<World>>) {
    let world = World { servos, baud: 1_000_000, ..World::default() };
    let world = Rc::new(RefCell::new(world));
    (ServoBus::over(Box::new(Wire(Rc::clone(&world))), BusOptions::default()), world)
}
