//! The schedule of the servo bus: control cycles, goals, torque, reads ([D12](protocol_core::decisions#d12)).
//!
//! ```text
//!   one cycle of 10 ms:   goals of all driven joints │ torque, if it is due │ one read of each servo
//!   a joint that engages:      goals, a read of its servo, torque
//! ```
//!
//! Goals are sent before torque, and read back, so that a lost frame does not give a servo torque with an old goal: see
//! goal_check.rs. During start-up only reads are sent. A silent servo is read ten times a second. On a slow bus not every
//! cycle reads each servo. This file does not know angles.

use protocol_core::registers::map::PROTECTION;
use protocol_core::registers::{JOINTS, Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use crate::CYCLE;
use crate::config::Config;
use crate::joints::Joints;
use crate::servo_bus::{Bus, Outcome};

/// How long start-up lasts at most. A servo that has not answered by then counts as silent. Real servos need about
/// 200 ms after power-up.
const START_UP_TIME: Duration = Duration::from_millis(500);
/// The torque switches are set again after this many control cycles, because a frame that set them may have been lost.
const TORQUE_REFRESH_CYCLES: u8 = 25;
/// This many cycles before a refresh, the scheduler begins to read the torque switches that were not read since the
/// last refresh: a switch is refreshed only if a read showed it on ([D28](protocol_core::decisions#d28)). The time is
/// enough for a bus on which a question takes 16 ms.
const TORQUE_READ_CYCLES: u8 = 12;

/// The servo bus and its schedule.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct BusScheduler {
    bus: Bus,
    /// When start-up ends at the latest; `None` once it is over.
    starting_until: Option<Instant>,
    next_cycle: Instant,
    /// How many more times the goals have to be sent.
    goals_due: u8,
    /// A joint engaged, and its goal was not sent yet.
    has_new_goal: bool,
    torque_due: bool,
    torque_refresh_in: u8,
    next_to_read: Joint,
    /// How many servos are still to be read in this cycle.
    left_to_read: usize,
}

impl BusScheduler {
    /// A bus at the start of the controller. The servos may have power already.
    pub(crate) fn new(now: Instant, config: &Config) -> Self {
        Self {
            bus: Bus::new(config.servo_baud, config.servo_timeout, config.guard_time, config.torque_codes),
            starting_until: Some(now + START_UP_TIME),
            next_cycle: now,
            goals_due: 0,
            has_new_goal: false,
            torque_due: false,
            torque_refresh_in: TORQUE_REFRESH_CYCLES,
            next_to_read: Joint::ALL[0],
            left_to_read: 0,
        }
    }

    /// Takes bytes that were received by `now`.
    pub(crate) fn servo_bytes(&mut self, now: Instant, bytes: &[u8]) {
        self.bus.bytes(now, bytes);
    }

    pub(crate) fn servo_byte_damaged(&mut self, now: Instant) {
        self.bus.damaged_byte(now);
    }

    pub(crate) const fn set_answer_delay(&mut self, delay: Duration) {
        self.bus.set_answer_delay(delay);
    }

    pub(crate) const fn take_longest_answers(&mut self) -> [u16; JOINTS] {
        self.bus.take_longest_answers()
    }

    /// The frame to send, after [`BusScheduler::prepare_frame`] returned true.
    pub(crate) fn frame(&self) -> &[u8] {
        self.bus.frame()
    }

    /// The outcome of the outstanding read, once it is known.
    pub(crate) fn outcome(&mut self, now: Instant) -> Option<Outcome> {
        self.bus.poll(now)
    }

    pub(crate) const fn is_starting(&self) -> bool {
        self.starting_until.is_some()
    }

    /// Ends start-up once every joint is measured or [`START_UP_TIME`] is over. Returns whether this call ended it.
    pub(crate) fn end_start_up(&mut self, now: Instant, joints: &Joints) -> bool {
        let is_over = self.starting_until.is_some_and(|until| now >= until || joints.silent() == 0);
        if is_over {
            self.starting_until = None;
        }
        is_over
    }

    /// Schedules goals, then a read of this joint's servo, because the joint engaged.
    pub(crate) fn joint_engaged(&mut self, joint: Joint) {
        self.goals_changed();
        self.has_new_goal = true;
        self.next_to_read = joint;
        self.left_to_read += 1;
    }

    /// Schedules the goals, `goals` times, then torque.
    pub(crate) fn torque_due_after(&mut self, goals: u8) {
        self.goals_due = self.goals_due.max(goals);
        self.torque_due = true;
    }

    /// Schedules torque, because the motor state changed or was written again, or an alarm has freed a joint.
    pub(crate) const fn torque_changed(&mut self) {
        self.torque_due = true;
    }

    /// The time at which the next control cycle was due; `None` if it is not due yet. After a pause at most one missed
    /// cycle is repeated: motion becomes late, not faster.
    pub(crate) fn cycle_due(&self, now: Instant) -> Option<Instant> {
        (now >= self.next_cycle).then(|| self.next_cycle.max(earlier(now, CYCLE)))
    }

    /// Begins the control cycle that was due at `due`.
    pub(crate) fn begin_cycle(&mut self, due: Instant) {
        self.next_cycle = due + CYCLE;
        self.left_to_read = JOINTS;
        self.torque_refresh_in = self.torque_refresh_in.saturating_sub(1);
        self.torque_due |= self.torque_refresh_in == 0;
    }

    /// Schedules goals, because the set-points have advanced or a joint engaged.
    pub(crate) fn goals_changed(&mut self) {
        self.goals_due = self.goals_due.max(1);
    }

    /// Prepares the next frame if one is due and the bus is free. Returns whether there is a frame to send. Before a new
    /// goal or torque, a joint whose measurement is too old stops engaging ([`Joints::expire_pending`]).
    pub(crate) fn prepare_frame(
        &mut self,
        now: Instant,
        joints: &mut Joints,
        registers: &RegisterFile,
    ) -> bool {
        if self.torque_due || self.has_new_goal {
            joints.expire_pending(now);
        }
        self.bus.is_free(now)
            && (self.prepare_goals(now, joints, registers)
                || self.prepare_torque(now, joints, registers)
                || self.prepare_read(now, joints))
    }

    fn prepare_goals(&mut self, now: Instant, joints: &Joints, registers: &RegisterFile) -> bool {
        if self.goals_due == 0 {
            return false;
        }
        self.goals_due -= 1;
        self.has_new_goal = false;
        let any = joints.any_goal(now);
        if any {
            self.bus.set_goals(now, joints.goals(now, registers));
        }
        any
    }

    fn prepare_torque(&mut self, now: Instant, joints: &mut Joints, registers: &RegisterFile) -> bool {
        if self.is_starting() || !core::mem::take(&mut self.torque_due) {
            return false;
        }
        self.torque_refresh_in = TORQUE_REFRESH_CYCLES;
        let switches = joints.take_torque(registers.get(PROTECTION.address) != 0);
        let any = switches.iter().any(Option::is_some);
        if any {
            let named = Joint::ALL.into_iter().zip(switches);
            self.bus.set_torque(now, named.filter_map(|(joint, torque)| Some((joint, torque?))));
        }
        any
    }

    /// Reads the next servo of this cycle, if no read is outstanding.
    fn prepare_read(&mut self, now: Instant, joints: &Joints) -> bool {
        while self.left_to_read > 0 && !self.bus.is_asking() {
            self.left_to_read -= 1;
            let joint = self.next_to_read;
            self.next_to_read = Joint::from_index(joint.index() + 1).unwrap_or(Joint::ALL[0]);
            let is_refresh_near = self.torque_refresh_in <= TORQUE_READ_CYCLES;
            if let Some(question) = joints.question(joint, now, is_refresh_near) {
                self.bus.ask(now, joint, question);
                return true;
            }
        }
        false
    }

    /// When the next action of the bus is due.
    pub(crate) fn deadline(&self, now: Instant) -> Instant {
        self.next_cycle.min(self.bus.deadline(now).unwrap_or(Instant::FAR_FUTURE))
    }
}

fn earlier(now: Instant, by: Duration) -> Instant {
    Instant::from_micros(now.as_micros().saturating_sub(by.as_micros()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor_state::MotorState;
    use crate::servo_bus::TorqueCodes;
    use crate::servo_bus::frame::Instruction;

    fn at(micros: u64) -> Instant {
        Instant::from_micros(micros)
    }

    fn scheduler() -> BusScheduler {
        let config = Config {
            chip_id: [0; 6],
            faults: 0,
            servo_baud: 1_000_000,
            servo_timeout: Duration::from_millis(1),
            guard_time: Duration::from_micros(100),
            torque_codes: TorqueCodes::default(),
        };
        BusScheduler::new(at(0), &config)
    }

    /// The instructions and ids of the frames in one cycle without answers.
    fn cycle(scheduler: &mut BusScheduler, joints: &mut Joints, start: u64) -> Vec<(u8, u8)> {
        let registers = RegisterFile::new([0; 6], None);
        scheduler.begin_cycle(at(start));
        let mut frames = Vec::new();
        for now in (start..start + 10_000).step_by(100).map(at) {
            let _ = scheduler.outcome(now);
            if scheduler.prepare_frame(now, joints, &registers) {
                frames.push((scheduler.frame()[4], scheduler.frame()[2]));
            }
        }
        frames
    }

    const READ: u8 = Instruction::Read as u8;

    #[test]
    fn each_servo_is_read_once_per_cycle() {
        let (mut scheduler, mut joints) = (scheduler(), Joints::new(MotorState::Servo));
        let reads: Vec<_> = (0..7).map(|id| (READ, id)).collect();
        assert_eq!(cycle(&mut scheduler, &mut joints, 0), reads);
        assert_eq!(cycle(&mut scheduler, &mut joints, 10_000), reads);
    }

    #[test]
    fn d12_a_change_of_state_waits_for_the_end_of_start_up() {
        let (mut scheduler, mut joints) = (scheduler(), Joints::new(MotorState::Damping));
        scheduler.torque_changed();
        assert!(cycle(&mut scheduler, &mut joints, 0).iter().all(|&(code, _)| code == READ));
        assert!(
            !scheduler.end_start_up(at(499_999), &joints) && scheduler.end_start_up(at(500_000), &joints)
        );
        let first = cycle(&mut scheduler, &mut joints, 500_000).first().copied();
        assert_eq!(first, Some((Instruction::SyncWrite as u8, 0xFE)));
    }

    #[test]
    fn at_most_one_missed_cycle_is_repeated() {
        let mut scheduler = scheduler();
        let mut cycle = |now| scheduler.cycle_due(at(now)).inspect(|&due| scheduler.begin_cycle(due));
        assert_eq!(cycle(0), Some(at(0)));
        assert_eq!(cycle(9_999), None);
        let late = [3_000_000, 3_000_000, 3_009_999, 3_010_000].map(cycle);
        assert_eq!(late, [Some(at(2_990_000)), Some(at(3_000_000)), None, Some(at(3_010_000))]);
    }
}
