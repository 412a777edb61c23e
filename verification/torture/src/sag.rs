//! Measures how far the arm sags while the controller, the servo bus or a servo fails (`torture sag`).
//!
//! The arm holds a pose that loads joints 2 and 3. Then one failure occurs. The sag is the largest distance of each joint
//! from its angle before the failure. The angles are the true angles of the plant with gravity, sampled once per
//! millisecond of virtual time.

use std::fmt::{self, Display};

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::servo::ServoFault;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::TorqueCodes;
use protocol_core::registers::map::TARGET_POSITION;
use protocol_core::registers::{JOINTS, Joint};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};

use crate::panic_handler::{FRAMES, damping_frame};
use crate::seeded_rng::SeededRng;

/// Targets in degrees: the rear arm leans to the front, the forearm points down by 35 degrees.
pub const POSE: [u8; JOINTS] = [90, 60, 100, 90, 90, 90, 80];
/// The time for start-up, the time for the move to [`POSE`], and the time of the measurement after each failure.
pub const SETTLE_TIME: Duration = Duration::from_millis(5_000);
/// The sampling period of the joint angles.
const SAMPLE_TIME: Duration = Duration::from_millis(1);
/// The time from a hang of the program to the restart by the watchdog.
pub const WATCHDOG_TIME: Duration = Duration::from_millis(2_000);
/// The duration of noise, and of the silence of a servo.
pub const DISTURBANCE_TIME: Duration = Duration::from_millis(3_000);
/// Random bytes of noise per millisecond.
pub const NOISE_BYTES: usize = 4;
/// The pause before each frame of the panic handler.
const PANIC_PAUSE: Duration = Duration::from_millis(2);

/// Joint 3, which lifts the forearm.
pub const FOREARM: Joint = Joint::ALL[2];

/// The failures whose sag is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SagCause {
    /// The controller alone restarts at once.
    WarmRestart,
    /// The program hangs for two seconds, then the watchdog restarts the controller.
    Watchdog,
    /// The program panics, commands damping (state 0) to all servos four times, and restarts.
    Panic,
    /// Three seconds of random bytes to the servos, while each reply has an invalid checksum.
    Noise,
    /// The replies of joint 3 are lost for three seconds.
    SilentServo,
}

impl SagCause {
    /// All failures, in the order of the table.
    pub const ALL: [Self; 5] =
        [Self::WarmRestart, Self::Watchdog, Self::Panic, Self::Noise, Self::SilentServo];

    const fn name(self) -> &'static str {
        match self {
            Self::WarmRestart => "warm restart (the controller alone)",
            Self::Watchdog => "watchdog restart (the controller hangs for 2 s)",
            Self::Panic => "panic (state 0 to all servos four times, then a restart)",
            Self::Noise => "noise on the servo bus for 3 s",
            Self::SilentServo => "answers of joint 3 lost for 3 s",
        }
    }
}

/// The largest distance of each joint from its angle before the failure, in thousandths of a degree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sag([u32; JOINTS]);

impl Sag {
    /// Measures the sag during a failure and for five seconds afterwards.
    #[must_use]
    pub fn over(cause: SagCause) -> Self {
        let mut arm = PosedArm::new();
        arm.inject(cause);
        arm.run(SETTLE_TIME);
        arm.sag
    }

    /// Adds a sample of the joint angles. `rest` holds the angles before the failure.
    pub fn sample(&mut self, rest: &[i32; JOINTS], angles: [i32; JOINTS]) {
        for ((largest, rest), angle) in self.0.iter_mut().zip(rest).zip(angles) {
            *largest = (*largest).max(angle.abs_diff(*rest));
        }
    }

    /// The sag of a joint, in thousandths of a degree.
    #[must_use]
    pub fn of(&self, joint: Joint) -> u32 {
        self.0.get(usize::from(joint.index())).copied().unwrap_or(0)
    }

    /// The joint with the largest sag.
    #[must_use]
    pub fn worst(&self) -> Joint {
        Joint::ALL.into_iter().rev().max_by_key(|&joint| self.of(joint)).unwrap_or(FOREARM)
    }
}

/// An arm that holds [`POSE`].
struct PosedArm {
    world: SimulatedArm<Flash>,
    now: Instant,
    rest: [i32; JOINTS],
    sag: Sag,
}

impl PosedArm {
    fn new() -> Self {
        let now = Instant::ZERO;
        let setup = ArmConfig { chip_id: [0; 6], is_paced: false, torque_codes: TorqueCodes::default() };
        let world = SimulatedArm::new(now, setup, Flash::in_memory(), Plant::new(now));
        let mut arm = Self { world, now, rest: [0; JOINTS], sag: Sag::default() };
        arm.run(SETTLE_TIME);
        let request = Request::Write { address: TARGET_POSITION.address, values: &POSE };
        arm.world.host_request(arm.now, &request);
        arm.run(SETTLE_TIME);
        arm.rest = arm.angles();
        arm.sag = Sag::default();
        arm
    }

    fn angles(&self) -> [i32; JOINTS] {
        Joint::ALL.map(|joint| self.world.plant().angle(joint))
    }

    /// Simulates this time and samples the angles.
    fn run(&mut self, time: Duration) {
        let until = self.now + time;
        while self.now < until {
            self.now = self.now + SAMPLE_TIME;
            self.world.advance(self.now, true);
            let angles = self.angles();
            self.sag.sample(&self.rest, angles);
        }
    }

    fn inject(&mut self, cause: SagCause) {
        match cause {
            SagCause::WarmRestart => self.world.restart_controller(self.now),
            SagCause::Watchdog => {
                self.world.halt_controller(self.now);
                self.run(WATCHDOG_TIME);
                self.world.restart_controller(self.now);
            }
            SagCause::Panic => self.panic(),
            SagCause::Noise => self.noise(),
            SagCause::SilentServo => {
                // No reply arrives before the end of the measurement.
                self.world
                    .plant_mut()
                    .set_fault(FOREARM, Some(ServoFault::Late(Duration::from_millis(3_600_000))));
                self.run(DISTURBANCE_TIME);
                self.world.plant_mut().set_fault(FOREARM, None);
            }
        }
    }

    fn panic(&mut self) {
        let frame = damping_frame(TorqueCodes::default());
        self.world.halt_controller(self.now);
        for _ in 0..FRAMES {
            self.run(PANIC_PAUSE);
            self.world.plant_mut().bytes(self.now, &frame);
        }
        self.run(SAMPLE_TIME);
        self.world.restart_controller(self.now);
    }

    fn noise(&mut self) {
        let mut rng = SeededRng::new(1);
        self.set_all_faults(Some(ServoFault::Garbled(1)));
        let until = self.now + DISTURBANCE_TIME;
        while self.now < until {
            let noise = [(); NOISE_BYTES].map(|()| rng.byte());
            self.world.plant_mut().bytes(self.now, &noise);
            self.run(SAMPLE_TIME);
        }
        self.set_all_faults(None);
    }

    fn set_all_faults(&mut self, fault: Option<ServoFault>) {
        Joint::ALL.into_iter().for_each(|joint| self.world.plant_mut().set_fault(joint, fault));
    }
}

/// The sag for each failure, in the order of [`SagCause::ALL`]. It prints itself as a table in Markdown.
#[derive(Clone, Debug)]
pub struct SagTable(pub Vec<(SagCause, Sag)>);

impl SagTable {
    /// Measures the sag for all failures.
    #[must_use]
    pub fn measure() -> Self {
        Self(SagCause::ALL.into_iter().map(|cause| (cause, Sag::over(cause))).collect())
    }
}

impl Display for SagTable {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "| failure | worst joint | joint 3 |\n| --- | --- | --- |")?;
        for (cause, sag) in &self.0 {
            let forearm = degrees(sag.of(FOREARM));
            write!(out, "\n| {} | {} | {forearm}° |", cause.name(), worst_cell(sag))?;
        }
        Ok(())
    }
}

fn worst_cell(sag: &Sag) -> String {
    let worst = sag.worst();
    match sag.of(worst) {
        0 => "0.00°".to_owned(),
        millidegrees => format!("{}° (joint {})", degrees(millidegrees), worst.number()),
    }
}

/// Degrees with two decimals, rounded up, so that a small motion is not shown as 0.
fn degrees(millidegrees: u32) -> String {
    let hundredths = millidegrees.div_ceil(10);
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The greatest distance of each joint from its set-point under its load in the pose, in thousandths of a degree.
    fn droops() -> [u32; JOINTS] {
        let arm = PosedArm::new();
        Joint::ALL.map(|joint| arm.world.plant().droop(joint).unwrap().unsigned_abs())
    }

    #[test]
    fn an_arm_whose_controller_keeps_its_goals_holds_its_pose() {
        for cause in [SagCause::Noise, SagCause::SilentServo] {
            let sag = Sag::over(cause);
            assert_eq!(sag.of(sag.worst()), 0, "{cause:?}: {sag:?}");
        }
    }

    #[test]
    fn a_restart_of_the_controller_costs_at_most_a_droop() {
        // The controller keeps the goal of a servo within 3 degrees of its joint (D12). Otherwise the measured position, rounded
        // to a count, is the new goal, and the joint droops once more.
        for cause in [SagCause::WarmRestart, SagCause::Watchdog] {
            let sag = Sag::over(cause);
            for (joint, droop) in Joint::ALL.into_iter().zip(droops()) {
                assert!(sag.of(joint) <= droop + 150, "{cause:?}: {sag:?} of {droop}");
            }
        }
    }

    #[test]
    fn an_arm_that_panics_sinks_and_is_caught() {
        let sag = Sag::over(SagCause::Panic);
        for (joint, droop) in Joint::ALL.into_iter().zip(droops()) {
            assert!(sag.of(joint) <= droop + 350, "{sag:?}");
        }
        assert!(sag.of(sag.worst()) > 0, "{sag:?}");
    }

    #[test]
    fn the_plant_shows_a_fall() {
        let mut arm = PosedArm::new();
        arm.world.plant_mut().restart_servo(arm.now, FOREARM);
        arm.run(Duration::from_millis(500));
        assert!(arm.sag.of(FOREARM) > 5_000, "{:?}", arm.sag);
    }

    #[test]
    fn degrees_are_rounded_up() {
        assert_eq!([0, 1, 10, 1_991, 12_340].map(degrees), ["0.00", "0.01", "0.01", "2.00", "12.34"]);
    }
}
