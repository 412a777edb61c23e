//! Control of the arm under test, apart from its host link.

use std::path::{Path, PathBuf};

/// A capability that not every arm under test has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// It was just switched on, is in the standard pose, and has received no write.
    FreshArm,
    /// Its chip id can be chosen.
    ChosenChipId,
    /// It can be switched off and on.
    PowerCycle,
    /// It can be killed at any time, and restarted.
    Kill,
    /// It keeps its settings over power cuts.
    Persistence,
    /// Its servos can be made to fail.
    ServoFaults,
    /// A stand can support it, so that it does not fall without torque.
    Support,
    /// Its settings storage may be filled.
    ExpendableStorage,
    /// It notices when the last program closes its port.
    SeesClosing,
}

/// An arm under test. A test may call a method only if the arm has the capability.
pub trait ArmControl {
    /// The path of its serial port. [`ArmControl::restart_after_kill`] may change it.
    fn port(&self) -> &Path;

    /// Why this arm lacks a capability; `None` if it has it.
    fn lacks(&self, need: Need) -> Option<&'static str>;

    /// Switches its power off and on. Does not wait for its start.
    fn power_cycle(&mut self) {
        unreachable!("the arm lacks this capability");
    }

    /// Restarts its controller. The servos keep their power.
    fn restart_controller(&mut self) {
        unreachable!("the arm lacks this capability");
    }

    /// Kills it and starts it again.
    fn restart_after_kill(&mut self) {
        unreachable!("the arm lacks this capability");
    }
}

/// The arm on the port in the variable `ARM_PORT`.
pub struct ExternalArm(pub PathBuf);

impl ArmControl for ExternalArm {
    fn port(&self) -> &Path {
        &self.0
    }

    fn lacks(&self, need: Need) -> Option<&'static str> {
        Some(match need {
            Need::FreshArm => "the arm on ARM_PORT was switched on before the tests",
            Need::ChosenChipId => "the chip id of the arm on ARM_PORT cannot be chosen",
            Need::PowerCycle => "the tests cannot switch the arm on ARM_PORT off and on",
            Need::Kill => "the tests cannot kill the arm on ARM_PORT",
            Need::Persistence => "the arm on ARM_PORT may keep no settings, as in an emulator",
            Need::ServoFaults => "the servos of the arm on ARM_PORT cannot be made to fail",
            Need::Support => "the arm on ARM_PORT falls without torque",
            Need::SeesClosing => "the arm on ARM_PORT may not notice who has its port open",
            Need::ExpendableStorage => "the tests must not wear out the flash of the arm on ARM_PORT",
        })
    }
}
