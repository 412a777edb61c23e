//! The simulated arm in front of an obstacle, in virtual time.

use std::convert::Infallible;

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::TorqueCodes;
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};

use super::arm::ObstacleArm;

/// A simulated arm in virtual time, for `torture obstacles`.
pub struct SimulatedObstacleArm {
    world: SimulatedArm<Flash>,
    now: Instant,
}

impl ObstacleArm for SimulatedObstacleArm {
    type Error = Infallible;

    fn start() -> Result<Self, Infallible> {
        let now = Instant::ZERO;
        let setup = ArmConfig { chip_id: [0; 6], is_paced: false, torque_codes: TorqueCodes::default() };
        Ok(Self { world: SimulatedArm::new(now, setup, Flash::in_memory(), Plant::new(now)), now })
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn plant(&mut self) -> &mut Plant {
        self.world.plant_mut()
    }

    fn write(&mut self, address: u8, values: &[u8]) -> Result<(), Infallible> {
        self.world.host_request(self.now, &Request::Write { address, values });
        Ok(())
    }

    fn read(&mut self, address: u8) -> Result<u8, Infallible> {
        // The arm updates some registers only when a host reads them.
        self.world.host_request(self.now, &Request::Read { address, count: 1 });
        self.world.advance(self.now, true);
        self.world.host_take(self.world.host_received().len());
        Ok(self.world.controller().registers().get(address))
    }

    fn step(&mut self) -> Result<(), Infallible> {
        self.now = self.now + Duration::from_millis(1);
        self.world.advance(self.now, true);
        Ok(())
    }
}
