//! A [`ServoLine`] to simulated servos in virtual time.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex};
use std::time::{self, Duration};

use arm_sim::servo::{Servo, ServoConfig, ServoFault};
use motion_core::servo_bus::frame::{Decoder, ServoFrame};
use protocol_core::registers::Joint;
use protocol_core::time::Instant;

use crate::error::PortError;
use crate::host_line::HostLine;
use crate::servo_bench::bus_master::{BusMaster, BusOptions};
use crate::servo_bench::error::ServoError;
use crate::servo_bench::servo_line::ServoLine;

/// The supply voltage in 0.1 V.
const SUPPLY: u8 = 74;
/// Time of one simulation step.
const STEP: Duration = Duration::from_millis(1);

/// A servo with more faults than the simulated arm has.
pub(crate) struct SimulatedServo {
    pub(crate) servo: Servo,
    /// Error bits added to each answer.
    pub(crate) errors: u8,
    /// When the servo loses its power.
    pub(crate) fails_at: Duration,
}

impl SimulatedServo {
    pub(crate) fn new(id: u8) -> Self {
        let mut servo = Servo::new(Joint::ALL[0], ServoConfig::default(), 300, Instant::ZERO);
        servo.set_id(id);
        // The first step fills the measurement registers.
        servo.step(Instant::ZERO, SUPPLY);
        Self { servo, errors: 0, fails_at: Duration::MAX }
    }

    pub(crate) fn with(id: u8, fault: ServoFault) -> Self {
        let mut simulated = Self::new(id);
        simulated.set_fault(Some(fault));
        simulated
    }

    pub(crate) fn set_fault(&mut self, fault: Option<ServoFault>) {
        self.servo.set_fault(Instant::ZERO, fault, Instant::ZERO);
    }

    /// The answer to a frame, and when it arrives.
    fn answer(&mut self, now: Duration, frame: &ServoFrame<'_>) -> Option<(Duration, Vec<u8>)> {
        if now >= self.fails_at {
            self.set_fault(Some(ServoFault::Missing));
        }
        let answer = self.servo.handle_frame(instant(now), frame)?;
        let mut bytes = answer.bytes.to_vec();
        bytes[4] |= self.errors;
        let checksum = bytes.last_mut()?;
        *checksum = checksum.wrapping_sub(self.errors);
        let delay = ServoConfig::default().return_delay.as_micros() + answer.delay.as_micros();
        Some((now + Duration::from_micros(delay), bytes))
    }
}

/// The adapter and the servos at the other end of the line, and the bytes on their way back.
#[derive(Default)]
pub(crate) struct SimulatedWire {
    pub(crate) servos: Vec<SimulatedServo>,
    pub(crate) has_echo: bool,
    pub(crate) echo_delay: Duration,
    /// After this many frames the port fails.
    pub(crate) frames_until_lost: Option<usize>,
    /// The rates of the adapter; empty means all.
    pub(crate) rates: Vec<u32>,
    baud: u32,
    now: Duration,
    /// The servos are simulated up to this time.
    simulated: Duration,
    /// Bytes and their times of arrival, in the order of arrival.
    in_transit: VecDeque<(Duration, Vec<u8>)>,
    pub(crate) sent: Vec<Vec<u8>>,
}

impl SimulatedWire {
    fn advance(&mut self) {
        while self.simulated + STEP <= self.now {
            self.simulated += STEP;
            for simulated in &mut self.servos {
                simulated.servo.step(instant(self.simulated), SUPPLY);
            }
        }
    }

    fn answers(&mut self, bytes: &[u8]) {
        let mut decoder = Decoder::new();
        decoder.push(bytes);
        let Some(Ok(frame)) = decoder.pull() else { return };
        for simulated in self.servos.iter_mut().filter(|simulated| simulated.servo.baud() == self.baud) {
            self.in_transit.extend(simulated.answer(self.now, &frame));
        }
    }
}

/// The line to the servos of a wire.
struct WireLine {
    wire: Arc<Mutex<SimulatedWire>>,
    /// The time of the line's clock at virtual time 0.
    start: time::Instant,
}

impl fmt::Debug for WireLine {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("WireLine").finish_non_exhaustive()
    }
}

impl HostLine for WireLine {
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let wire = &mut *self.wire.lock().unwrap();
        if wire.frames_until_lost.is_some_and(|frames| wire.sent.len() >= frames) {
            return Err(PortError::Lost(std::io::ErrorKind::BrokenPipe));
        }
        wire.sent.push(bytes.to_vec());
        if wire.has_echo {
            wire.in_transit.push_back((wire.now + wire.echo_delay, bytes.to_vec()));
        }
        wire.advance();
        wire.answers(bytes);
        wire.in_transit.make_contiguous().sort_by_key(|(at, _)| *at);
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, PortError> {
        let wire = &mut *self.wire.lock().unwrap();
        let deadline = wire.now + timeout;
        match wire.in_transit.pop_front_if(|(at, _)| *at <= deadline) {
            Some((at, bytes)) => {
                wire.now = wire.now.max(at);
                Ok(bytes)
            }
            None => {
                wire.now = deadline;
                Ok(Vec::new())
            }
        }
    }

    fn now(&self) -> time::Instant {
        self.start + self.wire.lock().unwrap().now
    }

    /// A pause before a frame takes no virtual time.
    fn sleep(&mut self, _: Duration) {}
}

impl ServoLine for WireLine {
    fn set_baud(&mut self, baud: u32) -> Result<(), ServoError> {
        let wire = &mut *self.wire.lock().unwrap();
        if !wire.rates.is_empty() && !wire.rates.contains(&baud) {
            return Err(ServoError::NoSuchRate { baud });
        }
        wire.baud = baud;
        Ok(())
    }
}

fn instant(time: Duration) -> Instant {
    Instant::from_micros(u64::try_from(time.as_micros()).unwrap())
}

/// A bus with these servos, at 1 Mbaud.
pub(crate) fn bus(servos: Vec<SimulatedServo>) -> (BusMaster, Arc<Mutex<SimulatedWire>>) {
    let wire = SimulatedWire { servos, baud: 1_000_000, ..SimulatedWire::default() };
    let wire = Arc::new(Mutex::new(wire));
    let line = WireLine { wire: Arc::clone(&wire), start: time::Instant::now() };
    (BusMaster::with_line(Box::new(line), BusOptions::default()), wire)
}
