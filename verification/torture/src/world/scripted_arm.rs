//! A controller that is scripted by a test, with simulated servos and the checkers of commands and motion.

use arm_sim::servo::ServoConfig;
use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{ServoFrameBuffer, read, register, sync_write};
use motion_core::{Storage, TorqueCodes};
use protocol_core::registers::{Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use super::command_checker::{CommandChecker, CommandContext};
use super::disturbed_bus::DisturbedBus;
use super::register_model::RegisterModel;
use super::status_checker::StatusContext;
use super::watchdog_model::WatchdogModel;
use crate::per_joint::PerJoint;
use crate::seeded_rng::SeededRng;
use crate::violation::Check;

/// The timeout of a read.
const TIMEOUT: Duration = Duration::from_millis(3);
/// The number of registers in a reading.
const READING: u8 = 8;
/// The number of registers from the torque switch to the end of a reading.
const WITH_TORQUE: u8 = 24;

/// The arm of a test. Its first joint carries no weight.
pub(super) struct ScriptedArm {
    pub(super) now: Instant,
    pub(super) bus: DisturbedBus,
    pub(super) model: RegisterModel,
    pub(super) registers: RegisterFile,
    pub(super) checker: CommandChecker,
    /// True if the controller runs, knows its servos and protects them.
    pub(super) is_guarded: bool,
    /// The limit of all pushes in 0.1 %, if there is one.
    pub(super) push_limit: Option<i16>,
    rng: SeededRng,
}

impl ScriptedArm {
    /// An arm in state servo a second after power-up. No servo was asked.
    pub(super) fn started() -> Self {
        let now = Instant::ZERO;
        let chip_id = [0; 6];
        let mut arm = Self {
            now,
            bus: DisturbedBus::new(now, ServoConfig::default(), [TIMEOUT, TIMEOUT]),
            model: RegisterModel::new(chip_id, None, Storage::Ready),
            registers: RegisterFile::new(chip_id, None),
            checker: CommandChecker::new(now, TorqueCodes::default(), TIMEOUT),
            is_guarded: true,
            push_limit: None,
            rng: SeededRng::new(1),
        };
        arm.bus.power_cycle(now);
        arm.run(1_000).unwrap();
        arm
    }

    /// An arm with this joint engaged at its position.
    pub(super) fn with_engaged(joint: Joint) -> Self {
        let mut arm = Self::started();
        arm.engage(joint).unwrap();
        arm
    }

    /// Restarts the controller alone, and lets its start-up time pass.
    pub(super) fn restart_controller(&mut self) {
        self.checker = CommandChecker::new(self.now, TorqueCodes::default(), TIMEOUT);
        self.run(600).unwrap();
    }

    /// Lets time pass, in milliseconds, and checks the motion of the joints.
    pub(super) fn run(&mut self, millis: u64) -> Check {
        for _ in 0..millis {
            self.now = self.now + Duration::from_millis(1);
            let bytes = self.bus.receive(self.now, &mut self.rng);
            self.checker.replies_received(self.now, &bytes);
            let limits = PerJoint::all(self.push_limit);
            self.bus.check_motion(self.now, self.model.is_servo(), self.is_guarded, limits)?;
        }
        Ok(())
    }

    /// Checks a frame, sends it if it is allowed, and waits until the wire is free.
    pub(super) fn send(&mut self, frame: &[u8]) -> Check {
        let Self { now, registers, model, bus, .. } = self;
        let checked = self.checker.check(frame, &CommandContext { now: *now, registers, model, bus });
        if checked.is_err() {
            self.run(1)?;
            return checked;
        }
        self.send_unchecked(frame)
    }

    /// Sends a frame although the rules may forbid it.
    pub(super) fn send_unchecked(&mut self, frame: &[u8]) -> Check {
        self.bus.send(self.now, frame, &mut self.rng);
        self.run(2)
    }

    /// Asks a servo for its torque and its measurements. It answers if it can.
    pub(super) fn ask(&mut self, joint: Joint) -> Check {
        self.ask_for(joint, register::TORQUE_SWITCH, WITH_TORQUE)
    }

    /// Asks a servo for its measurements alone.
    pub(super) fn ask_for_reading(&mut self, joint: Joint) -> Check {
        self.ask_for(joint, register::PRESENT_POSITION, READING)
    }

    fn ask_for(&mut self, joint: Joint, register: u8, count: u8) -> Check {
        let mut frame = ServoFrameBuffer::new();
        read(&mut frame, joint.index(), register, count);
        self.send(&frame)
    }

    pub(super) fn goal(&mut self, joint: Joint, counts: u16) -> Check {
        self.send(&goal_frame(joint, counts))
    }

    pub(super) fn torque(&mut self, joint: Joint, torque: Torque) -> Check {
        self.send(&torque_frame(joint, torque))
    }

    /// Engages a joint at its position.
    pub(super) fn engage(&mut self, joint: Joint) -> Check {
        self.ask(joint)?;
        self.goal(joint, self.bus.position(joint))?;
        self.ask(joint)?;
        self.torque(joint, Torque::On)?;
        self.ask(joint)
    }

    /// The context of the status checks.
    pub(super) fn status(&self) -> StatusContext<'_> {
        let Self { now, registers, model, bus, checker, .. } = self;
        let watchdog = &WatchdogModel::OFF;
        StatusContext { now: *now, registers, model, watchdog, bus, command_checker: checker }
    }
}

/// A frame with the goal of one joint.
pub(super) fn goal_frame(joint: Joint, counts: u16) -> ServoFrameBuffer {
    let mut frame = ServoFrameBuffer::new();
    let [high, low] = counts.to_be_bytes();
    sync_write(&mut frame, register::GOAL_POSITION, [(joint.index(), [high, low, 0, 10, 0, 0])].into_iter());
    frame
}

/// A frame with the torque switch of one joint.
pub(super) fn torque_frame(joint: Joint, torque: Torque) -> ServoFrameBuffer {
    let mut frame = ServoFrameBuffer::new();
    let code = TorqueCodes::default().code(torque);
    sync_write(&mut frame, register::TORQUE_SWITCH, [(joint.index(), [code])].into_iter());
    frame
}
