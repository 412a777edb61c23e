//! `cargo xtask obstacles`: what becomes of the arm at obstacles, with the image in the emulator as the controller.
//!
//! The experiments and tables are those of `torture obstacles`, a few of them. They run in real time, so a busy machine
//! increases the figures.

use std::error::Error;

use arm_sim::plant::Plant;
use protocol_core::request::Request;
use protocol_core::time::Instant;
use torture::obstacles::{Experiments, ObstacleArm};

use crate::run::{self, TaskResult};
use crate::sag::{EmulatedArm, STEP};
use emulator::need_qemu;

/// Builds the image, makes the experiments and prints their tables.
pub(crate) fn measure() -> TaskResult {
    need_qemu()?;
    run::build_image()?;
    println!("{}", Experiments::few().measure::<EmulatedArm>()?);
    Ok(())
}

impl ObstacleArm for EmulatedArm {
    type Error = Box<dyn Error>;

    fn start() -> TaskResult<Self> {
        Self::start()
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn plant(&mut self) -> &mut Plant {
        &mut self.plant
    }

    fn write(&mut self, address: u8, values: &[u8]) -> TaskResult {
        self.request(Request::Write { address, values })
    }

    fn read(&mut self, address: u8) -> TaskResult<u8> {
        self.register(address)
    }

    fn step(&mut self) -> TaskResult {
        self.run(STEP).map(drop)
    }
}
