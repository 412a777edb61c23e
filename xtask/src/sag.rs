//! `cargo xtask sag`: measures how far the arm sags during a failure, with the image in the emulator as the controller.
//!
//! ```text
//!   EmulatedArm ── host link ── USART1 ┌──────────┐ USART2 ── servo bus ── Plant (true angles)
//!               ── monitor ─────────── │   qemu   │
//!               ── debugger ────────── │ the image│
//!                                      └──────────┘
//! ```
//!
//! The failures and the table are those of `torture sag`. It measures in real time, so a busy machine increases the figures.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::thread::sleep;
use std::time::Duration as RealTime;

use arm_sim::plant::Plant;
use arm_sim::servo::ServoFault;
use host_sim::clock::RealClock;
use host_sim::servo_socket::exchange;
use linked_image::Program;
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};
use protocol_core::wire::FrameBuffer;
use tempfile::TempDir;
use torture::sag::{
    DISTURBANCE_TIME, FOREARM, NOISE_BYTES, POSE, SETTLE_TIME, Sag, SagCause, SagTable, WATCHDOG_TIME,
};
use torture::seeded_rng::SeededRng;

use crate::run::{self, ChildProcess, TaskResult};
use emulator::debugger::Debugger;
use emulator::monitor::{self, Monitor};
use emulator::{HOST_LINK_CONTROL, RECEIVER_ON, need_qemu, servo_socket, start_machine};

/// The period of the servo bus and of the samples.
const SAMPLE_PERIOD: RealTime = RealTime::from_micros(200);
/// A step of an experiment with the arm.
pub(crate) const STEP: Duration = Duration::from_millis(1);
/// The longest wait for a reply, on a busy machine.
const REPLY_TIMEOUT: Duration = Duration::from_millis(5_000);
/// The period of the noise.
const NOISE_PERIOD: Duration = Duration::from_millis(1);
/// The symbol of the panic handler.
const PANIC_HANDLER: &str = "rust_begin_unwind";

/// Builds the image, measures the sag for each failure and prints the table.
pub(crate) fn measure() -> TaskResult {
    need_qemu()?;
    run::build_image()?;
    let sags: TaskResult<Vec<_>> =
        SagCause::ALL.into_iter().map(|cause| Ok((cause, sag_over(cause)?))).collect();
    println!("{}", SagTable(sags?));
    Ok(())
}

fn sag_over(cause: SagCause) -> TaskResult<Sag> {
    let mut arm = EmulatedArm::in_pose()?;
    arm.inject(cause)?;
    arm.run(SETTLE_TIME)?;
    Ok(arm.sag)
}

/// An emulated arm.
pub(crate) struct EmulatedArm {
    _machine: ChildProcess,
    folder: TempDir,
    monitor: Monitor,
    host: UnixStream,
    servos: UnixStream,
    pub(crate) plant: Plant,
    clock: RealClock,
    /// The time of the servos.
    pub(crate) now: Instant,
    rest: [i32; JOINTS],
    sag: Sag,
}

impl EmulatedArm {
    /// Switches an arm on.
    pub(crate) fn start() -> TaskResult<Self> {
        let folder = tempfile::tempdir()?;
        let listen = |name| UnixListener::bind(folder.path().join(name));
        let (host, commands, servos) = (listen("host")?, listen("monitor")?, listen("servos")?);
        let debugger = format!("unix:{},server=on,wait=off", folder.path().join("debugger").display());
        let machine = start_machine(&run::IMAGE, &folder, &servo_socket(&folder), &["-gdb", &debugger])?;
        let (host, servos) = (monitor::accept(&host)?, monitor::accept(&servos)?);
        host.set_nonblocking(true)?;
        servos.set_nonblocking(true)?;
        let mut monitor = Monitor::new(monitor::accept(&commands)?, folder.path())?;
        monitor.wait_for_bits(HOST_LINK_CONTROL, RECEIVER_ON)?;
        let mut clock = RealClock::default();
        let now = clock.now();
        let mut plant = Plant::new(now);
        plant.ignore_collisions();
        let (rest, sag) = ([0; JOINTS], Sag::default());
        Ok(Self { _machine: machine, folder, monitor, host, servos, plant, clock, now, rest, sag })
    }

    /// An arm that holds [`POSE`].
    fn in_pose() -> TaskResult<Self> {
        let mut arm = Self::start()?;
        arm.run(SETTLE_TIME)?;
        arm.request(Request::Write { address: TARGET_POSITION.address, values: &POSE })?;
        arm.run(SETTLE_TIME)?;
        arm.rest = arm.angles();
        arm.sag = Sag::default();
        arm.check_pose()?;
        Ok(arm)
    }

    /// Sends a request.
    pub(crate) fn request(&mut self, request: Request<'_>) -> TaskResult {
        let mut frame = FrameBuffer::new();
        request.encode(&mut frame);
        Ok(self.host.write_all(&frame)?)
    }

    /// Reads a register.
    pub(crate) fn register(&mut self, address: u8) -> TaskResult<u8> {
        self.request(Request::Read { address, count: 1 })?;
        let mut received = Vec::new();
        let until = self.now + REPLY_TIMEOUT;
        while self.now < until {
            self.run(STEP)?;
            let mut bytes = [0; 64];
            match self.host.read(&mut bytes) {
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

    /// Fails if the arm is not in its pose.
    fn check_pose(&self) -> TaskResult {
        let is_off = |(angle, degrees): (&i32, u8)| angle.abs_diff(i32::from(degrees) * 1_000) > 1_000;
        if self.rest.iter().zip(POSE).any(is_off) {
            Err(format!("the arm did not reach its pose: {:?} thousandths of a degree", self.rest))?;
        }
        Ok(())
    }

    fn angles(&self) -> [i32; JOINTS] {
        Joint::ALL.map(|joint| self.plant.angle(joint))
    }

    /// Runs the servos and samples the angles for this time. Returns the time at its end.
    pub(crate) fn run(&mut self, time: Duration) -> TaskResult<Instant> {
        let until = self.clock.now() + time;
        loop {
            self.now = self.clock.now();
            exchange(&mut self.servos, &mut self.plant, self.now)?;
            let angles = self.angles();
            self.sag.sample(&self.rest, angles);
            if self.now >= until {
                return Ok(self.now);
            }
            sleep(SAMPLE_PERIOD);
        }
    }

    fn inject(&mut self, cause: SagCause) -> TaskResult {
        match cause {
            SagCause::WarmRestart => self.monitor.execute("system_reset", ""),
            SagCause::Watchdog => {
                self.monitor.execute("stop", "")?;
                self.run(WATCHDOG_TIME)?;
                self.monitor.execute("system_reset", "")?;
                self.monitor.execute("cont", "")
            }
            SagCause::Panic => {
                Debugger::connect(&self.folder.path().join("debugger"))?.continue_at(panic_handler()?)
            }
            SagCause::Noise => self.noise(),
            SagCause::SilentServo => {
                // No reply arrives before the end of the measurement.
                self.plant.set_fault(FOREARM, Some(ServoFault::Late(Duration::from_millis(3_600_000))));
                self.run(DISTURBANCE_TIME)?;
                self.plant.set_fault(FOREARM, None);
                Ok(())
            }
        }
    }

    fn noise(&mut self) -> TaskResult {
        let mut rng = SeededRng::new(1);
        self.set_all_faults(Some(ServoFault::Garbled(1)));
        let mut now = self.clock.now();
        let until = now + DISTURBANCE_TIME;
        while now < until {
            self.plant.bytes(now, &[(); NOISE_BYTES].map(|()| rng.byte()));
            now = self.run(NOISE_PERIOD)?;
        }
        self.set_all_faults(None);
        Ok(())
    }

    fn set_all_faults(&mut self, fault: Option<ServoFault>) {
        Joint::ALL.into_iter().for_each(|joint| self.plant.set_fault(joint, fault));
    }
}

/// The address of the panic handler.
fn panic_handler() -> TaskResult<u32> {
    let file = run::IMAGE.read()?;
    let program = Program::read(&file)?;
    let handler = program.functions().find(|function| function.name.contains(PANIC_HANDLER));
    Ok(u32::try_from(handler.ok_or("the image has no panic handler")?.address)?)
}
