//! Trials of free motion: without an obstacle the protection changes no byte for the servos (D27).
//!
//! The motions come from motion-core's tests, with any seed. Two whole arms carry them out, one without protection.

use arm_sim::flash::Flash;
use arm_sim::plant::Plant;
use arm_sim::servo_bus::ServoBus;
use arm_sim::simulated_arm::{ArmConfig, SimulatedArm};
use motion_core::TorqueCodes;
use protocol_core::registers::map::{BLOCKED_JOINTS, LET_GO_JOINTS};
use protocol_core::request::Request;
use protocol_core::time::{Duration, Instant};

use crate::shared::free_moves::{FreeMoves, Step};

/// The time from power-up to the first write.
const START: Duration = Duration::from_millis(1_000);
/// The time for a short read and its reply at 115,200 baud, in milliseconds.
const READ_MS: u64 = 3;

/// What some motions showed. Each is carried out with and without protection.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FreeMotionTrial {
    /// The number of motions that were compared.
    pub motions: usize,
    /// The number of bytes to the servos that were compared.
    pub bytes: usize,
    /// The seeds of motions in which the bytes or their times differ, or in which a joint was blocked or let go with protection.
    pub different: Vec<u64>,
}

impl FreeMotionTrial {
    /// Adds the motions of another trial.
    pub fn add(&mut self, other: Self) {
        self.motions += other.motions;
        self.bytes += other.bytes;
        self.different.extend(other.different);
    }
}

/// Carries out the motion of a seed with and without protection, and compares the bytes to the servos.
#[must_use]
pub fn run(seed: u64) -> FreeMotionTrial {
    let [mut with, mut without] = [1, 0].map(|protection| MovedArm::after(&FreeMoves::of(seed, protection)));
    let is_equal = with.sent() == without.sent() && !with.was_blocked;
    let different = if is_equal { Vec::new() } else { vec![seed] };
    FreeMotionTrial { motions: 1, bytes: with.sent().len(), different }
}

/// Simulated servos, and every byte that was sent to them with its time.
struct RecordedServos {
    plant: Plant,
    sent: Vec<(Instant, u8)>,
}

impl ServoBus for RecordedServos {
    const IS_REAL: bool = false;

    fn baud(&self) -> u32 {
        ServoBus::baud(&self.plant)
    }

    fn answer_delay(&self) -> Duration {
        self.plant.answer_delay()
    }

    fn bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.sent.extend(bytes.iter().map(|byte| (now, *byte)));
        self.plant.bytes(now, bytes);
    }

    fn poll(&mut self, now: Instant) -> &[u8] {
        self.plant.poll(now)
    }

    fn deadline(&self) -> Option<Instant> {
        self.plant.deadline()
    }

    fn power_cycle(&mut self, now: Instant) {
        self.plant.power_cycle(now);
    }
}

/// An arm that carries out moves.
struct MovedArm {
    arm: SimulatedArm<Flash, RecordedServos>,
    now: Instant,
    was_blocked: bool,
}

impl MovedArm {
    fn after(moves: &FreeMoves) -> Self {
        let now = Instant::ZERO;
        let config = ArmConfig { chip_id: [0; 6], is_paced: true, torque_codes: TorqueCodes::default() };
        let mut plant = Plant::new(now);
        plant.set_load(moves.grams);
        let servos = RecordedServos { plant, sent: Vec::new() };
        let arm = SimulatedArm::new(now, config, Flash::in_memory(), servos);
        let mut arm = Self { arm, now, was_blocked: false };
        arm.pass(START);
        moves.steps.iter().for_each(|step| arm.carry_out(step));
        arm
    }

    fn sent(&mut self) -> &[(Instant, u8)] {
        &self.arm.bus().sent
    }

    fn carry_out(&mut self, step: &Step) {
        // Wait so long that both frames have left the line before the next one is sent.
        let wait_ms = step.wait_ms.max(5) - READ_MS;
        self.send(&Request::Write { address: step.address, values: &step.values }, wait_ms);
        // The arm updates these registers when a host reads them.
        let count = LET_GO_JOINTS.address - BLOCKED_JOINTS.address + 1;
        self.send(&Request::Read { address: BLOCKED_JOINTS.address, count }, READ_MS);
        self.arm.host_take(self.arm.host_received().len());
        let registers = self.arm.registers();
        self.was_blocked |= [BLOCKED_JOINTS, LET_GO_JOINTS].iter().any(|row| registers.get(row.address) != 0);
    }

    fn send(&mut self, request: &Request<'_>, wait_ms: u64) {
        self.arm.host_request(self.now, request);
        self.pass(Duration::from_millis(wait_ms));
    }

    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.now = (self.now + Duration::from_millis(1)).min(end);
            self.arm.advance(self.now, true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn d27_free_motion_of_a_whole_arm_is_byte_for_byte_that_without_protection() {
        let mut all = FreeMotionTrial::default();
        // With the last four seeds a joint reverses at full speed, which makes its push last longest.
        [0, 1, 2, 3, 78, 1111, 3009, 3707].into_iter().map(run).for_each(|trial| all.add(trial));
        assert_eq!((all.motions, all.different), (8, vec![]));
        assert!(all.bytes > 100_000, "{} bytes", all.bytes);
    }
}
