//! Measures how the arm behaves at obstacles, with the image in the emulator as the controller: `cargo xtask obstacles` builds
//! the image and runs this.
//!
//! It runs a few of the experiments of `torture obstacles`, and prints their tables. The experiments run in real time, so a
//! busy machine increases the figures.

use std::error::Error;

use arm_sim::plant::Plant;
use emulator::emulated_arm::EmulatedArm;
use emulator::need_qemu;
use emulator::process::TaskResult;
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};
use torture::obstacles::{Experiments, ObstacleArm};

/// The time of one call of [`ObstacleArm::step`].
const STEP: Duration = Duration::from_millis(1);

fn main() -> TaskResult {
    need_qemu()?;
    println!("{}", Experiments::few().measure::<Arm>()?);
    Ok(())
}

struct Arm(EmulatedArm);

impl ObstacleArm for Arm {
    type Error = Box<dyn Error>;

    fn start() -> TaskResult<Self> {
        EmulatedArm::start().map(Self)
    }

    fn now(&self) -> Instant {
        self.0.now()
    }

    fn plant(&mut self) -> &mut Plant {
        &mut self.0.plant
    }

    fn write(&mut self, address: u8, values: &[u8]) -> TaskResult {
        self.0.request(Request::Write { address, values })
    }

    fn read(&mut self, address: u8) -> TaskResult<u8> {
        self.0.register(address)
    }

    fn step(&mut self) -> TaskResult {
        self.0.run(STEP, |_| ())
    }
}
