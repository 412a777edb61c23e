//! Runs the image in the emulator in real time, with its simulated servos in this process.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::thread::sleep;
use std::time::Duration as RealTime;

use arm_sim::plant::Plant;
use host_sim::clock::RealClock;
use host_sim::servo_socket::exchange;
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};

use crate::frame;
use crate::machine::Machine;
use crate::process::TaskResult;

/// The pause between two exchanges with the servo bus, and between two samples.
const SAMPLE_PERIOD: RealTime = RealTime::from_micros(200);
/// The longest wait for a reply, on a busy machine.
const REPLY_TIMEOUT: Duration = Duration::from_millis(5_000);
/// The time between two checks for a reply.
const REPLY_PERIOD: Duration = Duration::from_millis(1);

/// The image in the emulator and its servos in this process, both in real time.
pub struct EmulatedArm {
    /// The simulated servos with their load.
    pub plant: Plant,
    machine: Machine,
    bus: UnixStream,
    clock: RealClock,
    now: Instant,
}

impl EmulatedArm {
    /// Starts the image and its servos, and waits until the image receives host bytes. Collisions on
    /// the servo bus are not simulated.
    pub fn start() -> TaskResult<Self> {
        let (mut machine, bus) = Machine::start_with_bus(tempfile::tempdir()?, &[])?;
        machine.host.set_nonblocking(true)?;
        machine.wait_for_host_link()?;
        let mut clock = RealClock::default();
        let now = clock.now();
        let mut plant = Plant::new(now);
        plant.ignore_collisions();
        Ok(Self { plant, machine, bus, clock, now })
    }

    /// The time of the last exchange with the servo bus.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Sends a request without waiting for a reply.
    pub fn request(&mut self, request: Request<'_>) -> TaskResult {
        Ok(self.machine.host.write_all(&frame(request))?)
    }

    /// Reads a register through the host link, and runs the servos until the reply arrives.
    pub fn register(&mut self, address: u8) -> TaskResult<u8> {
        self.request(Request::Read { address, count: 1 })?;
        let mut received = Vec::new();
        let until = self.now + REPLY_TIMEOUT;
        while self.now < until {
            self.run(REPLY_PERIOD, |_| ())?;
            let mut bytes = [0; 64];
            match self.machine.host.read(&mut bytes) {
                Ok(0) => Err("the emulator has ended")?,
                Ok(count) => received.extend(bytes.iter().take(count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => Err(error)?,
            }
            // Header, function, address, count, value, checksum: the reply to a read of one register.
            if let [.., 0xAA, 0x77, 3, at, 1, value, _, _] = *received
                && at == address
            {
                return Ok(value);
            }
        }
        Err(format!("no reply to a read of register {address}"))?
    }

    /// Runs the servos for this real time, and calls `sample` after each exchange with the servo bus.
    pub fn run(&mut self, time: Duration, mut sample: impl FnMut(&Plant)) -> TaskResult {
        let until = self.clock.now() + time;
        loop {
            self.now = self.clock.now();
            exchange(&mut self.bus, &mut self.plant, self.now)?;
            sample(&self.plant);
            if self.now >= until {
                return Ok(());
            }
            sleep(SAMPLE_PERIOD);
        }
    }

    /// Restarts the chip. The servos keep their power.
    pub fn reset(&mut self) -> TaskResult {
        self.machine.reset()
    }

    /// Stops the chip. The servos continue during [`Self::run`].
    pub fn stop(&mut self) -> TaskResult {
        self.machine.monitor.execute("stop", "")
    }

    /// Lets a stopped chip go on.
    pub fn resume(&mut self) -> TaskResult {
        self.machine.monitor.execute("cont", "")
    }

    /// Lets the chip continue at the instruction at `address`.
    pub fn jump_to(&mut self, address: u32) -> TaskResult {
        self.machine.debugger()?.continue_at(address)
    }
}
