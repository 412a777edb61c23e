//! What a test runs against, and what can be done to it besides sending bytes.

use std::path::Path;

/// Something an arm can do, or have done to it, that not every target can.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// It was just switched on, in the standard pose, and nobody has written to it yet.
    FreshArm,
    /// Its chip id can be chosen.
    ChosenChipId,
    /// It can be switched off and on.
    PowerCycle,
    /// It can die at any instant, and be started again.
    Kill,
    /// Its settings are kept over power cuts.
    Persistence,
    /// Its servos can be made to fail.
    ServoFaults,
    /// It does not fall where it has no torque.
    Support,
    /// Its settings storage may be filled to the brim.
    ExpendableStorage,
}

/// An arm that tests can run against.
pub trait Target {
    /// The name of its serial port. It may be another one after [`Target::restart_after_kill`].
    fn port(&self) -> &Path;

    /// Why this arm cannot meet a need; `None` if it can.
    fn lacks(&self, need: Need) -> Option<&'static str>;

    /// Takes its power and gives it back, without waiting for it to come up.
    fn power_cycle(&mut self);

    /// Restarts its controller, and leaves its servos under power.
    fn restart_controller(&mut self);

    /// Kills it, with no chance to tidy up, and starts it again.
    fn restart_after_kill(&mut self);
}

/// Whatever answers on the port named by `ARM_PORT`.
pub struct Port(pub std::path::PathBuf);

impl Target for Port {
    fn port(&self) -> &Path {
        &self.0
    }

    fn lacks(&self, need: Need) -> Option<&'static str> {
        Some(match need {
            Need::FreshArm => "the arm on ARM_PORT was switched on before the tests began",
            Need::ChosenChipId => "the arm on ARM_PORT has the chip id it has",
            Need::PowerCycle => "nobody is there to switch the arm on ARM_PORT off and on",
            Need::Kill => "the arm on ARM_PORT cannot be killed from here",
            Need::Persistence => "the arm on ARM_PORT may keep no settings, as in an emulator",
            Need::ServoFaults => "the servos of the arm on ARM_PORT cannot be made to fail",
            Need::Support => "the arm on ARM_PORT falls where it has no torque",
            Need::ExpendableStorage => "the flash of the arm on ARM_PORT is not to be worn out",
        })
    }

    fn power_cycle(&mut self) {
        unreachable!("no test gets here: the need is not met");
    }

    fn restart_controller(&mut self) {
        unreachable!("no test gets here: the need is not met");
    }

    fn restart_after_kill(&mut self) {
        unreachable!("no test gets here: the need is not met");
    }
}
