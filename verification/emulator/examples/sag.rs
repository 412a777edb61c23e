//! Measures how far the arm sags during a failure, with the image in the emulator as the controller: `cargo xtask sag` builds
//! the image and runs this.
//!
//! The failures and the table are the same as in `torture sag`. The measurement takes real time, so a busy machine increases
//! the figures.

use arm_sim::plant::Plant;
use arm_sim::servo::ServoFault;
use emulator::chip_program::IMAGE;
use emulator::emulated_arm::EmulatedArm;
use emulator::need_qemu;
use emulator::process::TaskResult;
use linked_image::Program;
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::request::Request;
use protocol_core::time::Duration;
use torture::sag::{
    DISTURBANCE_TIME, FOREARM, NOISE_BYTES, POSE, SETTLE_TIME, Sag, SagCause, SagTable, WATCHDOG_TIME,
};
use torture::seeded_rng::SeededRng;

/// The time between two bursts of [`NOISE_BYTES`] random bytes.
const NOISE_PERIOD: Duration = Duration::from_millis(1);
/// The symbol of the panic handler.
const PANIC_HANDLER: &str = "rust_begin_unwind";

fn main() -> TaskResult {
    need_qemu()?;
    let sags: TaskResult<Vec<_>> =
        SagCause::ALL.into_iter().map(|cause| Ok((cause, sag_over(cause)?))).collect();
    println!("{}", SagTable(sags?));
    Ok(())
}

fn sag_over(cause: SagCause) -> TaskResult<Sag> {
    let mut arm = PosedArm::new()?;
    arm.inject(cause)?;
    arm.run(SETTLE_TIME)?;
    Ok(arm.sag)
}

/// An emulated arm that holds [`POSE`].
struct PosedArm {
    arm: EmulatedArm,
    rest: [i32; JOINTS],
    sag: Sag,
}

impl PosedArm {
    fn new() -> TaskResult<Self> {
        let mut arm = EmulatedArm::start()?;
        arm.run(SETTLE_TIME, |_| ())?;
        arm.request(Request::Write { address: TARGET_POSITION.address, values: &POSE })?;
        arm.run(SETTLE_TIME, |_| ())?;
        let rest = angles(&arm.plant);
        let is_off = |(angle, degrees): (&i32, u8)| angle.abs_diff(i32::from(degrees) * 1_000) > 1_000;
        if rest.iter().zip(POSE).any(is_off) {
            Err(format!("the arm did not reach its pose: {rest:?} thousandths of a degree"))?;
        }
        Ok(Self { arm, rest, sag: Sag::default() })
    }

    /// Runs the servos and samples the angles for this time.
    fn run(&mut self, time: Duration) -> TaskResult {
        let Self { arm, rest, sag } = self;
        arm.run(time, |plant| sag.sample(rest, angles(plant)))
    }

    fn inject(&mut self, cause: SagCause) -> TaskResult {
        match cause {
            SagCause::WarmRestart => self.arm.reset(),
            SagCause::Watchdog => {
                self.arm.stop()?;
                self.run(WATCHDOG_TIME)?;
                self.arm.reset()?;
                self.arm.resume()
            }
            SagCause::Panic => self.arm.jump_to(panic_handler()?),
            SagCause::Noise => self.noise(),
            SagCause::SilentServo => {
                // No reply arrives before the end of the measurement.
                self.arm.plant.set_fault(FOREARM, Some(ServoFault::Late(Duration::from_millis(3_600_000))));
                self.run(DISTURBANCE_TIME)?;
                self.arm.plant.set_fault(FOREARM, None);
                Ok(())
            }
        }
    }

    fn noise(&mut self) -> TaskResult {
        let mut rng = SeededRng::new(1);
        self.set_all_faults(Some(ServoFault::Garbled(1)));
        let until = self.arm.now() + DISTURBANCE_TIME;
        while self.arm.now() < until {
            self.arm.plant.bytes(self.arm.now(), &[(); NOISE_BYTES].map(|()| rng.byte()));
            self.run(NOISE_PERIOD)?;
        }
        self.set_all_faults(None);
        Ok(())
    }

    fn set_all_faults(&mut self, fault: Option<ServoFault>) {
        Joint::ALL.into_iter().for_each(|joint| self.arm.plant.set_fault(joint, fault));
    }
}

fn angles(plant: &Plant) -> [i32; JOINTS] {
    Joint::ALL.map(|joint| plant.angle(joint))
}

/// The address of the panic handler.
fn panic_handler() -> TaskResult<u32> {
    let file = IMAGE.read()?;
    let program = Program::read(&file)?;
    let handler = program.functions().find(|function| function.name.contains(PANIC_HANDLER));
    Ok(u32::try_from(handler.ok_or("the image has no panic handler")?.address)?)
}
