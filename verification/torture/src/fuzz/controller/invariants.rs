//! The invariants:
//!
//! - Replies match the registers, and come after the save of settings.
//! - Goals do not jump, and keep the linkage.
//! - Torque is off outside motor state servo. The valve closes.
//! - Registers stay in their ranges. Fine targets and positions match the coarse ones.
//! - Storage errors are flagged.

use motion_core::calibration::{MicroDegrees, angle_from_counts};
use motion_core::servo_bus::Torque;
use motion_core::{Config, Storage, Vacuum};
use protocol_core::registers::map::{
    EEPROM_LOCK, FAULTS, LIMITS, MISSING_SERVOS, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED, fault, limit,
    motor_state,
};
use protocol_core::registers::map21::{OPTIONS, option};
use protocol_core::registers::{Access, Image, Joint, MAP, Register, RegisterFile};
use protocol_core::wire::frame::{Function, ParseOutcome, ToHost, parse};

use super::extended_block;
use super::scripted_replies::ServoCommand;
use crate::linkage_goals::LinkageGoals;

/// The largest step of a goal in a control cycle, in counts: per unit of the speed register (0.019 degrees), and at the
/// motor's maximum (3.72 degrees). 850 counts are 180 degrees.
const COUNTS_PER_SPEED: f64 = 0.019 * 850.0 / 180.0;
const MAX_COUNTS: f64 = 3.72 * 850.0 / 180.0;
const CYCLE_US: u64 = 10_000;
const VALVE_TIME_US: u64 = 500_000;

#[derive(Clone, Copy, Default)]
struct JointGoal {
    /// The last goal, its time in microseconds, and the number of polls at that time; `None` from start or torque-off until the
    /// next goal, which comes before the torque.
    goal: Option<(u16, u64, u32)>,
    /// The highest speed limit since the last goal, in counts per cycle.
    max_speed: f64,
}

pub struct InvariantChecker {
    config: Config,
    storage: Storage,
    /// The settings in the storage.
    pub settings: Image,
    calls: u32,
    joints: [JointGoal; 7],
    is_driven: [bool; 7],
    /// The time of the first wait in a motor state other than servo, in microseconds; `None` in servo, and after a torque command
    /// that leaves a joint driven.
    released_at: Option<u64>,
    valve_opened_at: Option<u64>,
    vacuum: Vacuum,
    linkage: LinkageGoals,
    /// The offsets of joints 2 and 3.
    offsets: [i8; 2],
}

impl InvariantChecker {
    pub fn new(config: Config, storage: Storage, registers: &RegisterFile) -> Self {
        Self {
            config,
            storage,
            settings: registers.image(),
            calls: 0,
            joints: [JointGoal::default(); 7],
            is_driven: [false; 7],
            released_at: None,
            valve_opened_at: None,
            vacuum: Vacuum::default(),
            linkage: LinkageGoals::default(),
            offsets: [0; 2],
        }
    }

    /// Checks that a frame to the host is complete, that its values match the registers, and that the settings were saved before.
    /// Checks of an alarm only that alarms are on.
    pub fn frame_to_host(&self, bytes: &[u8], registers: &RegisterFile) {
        let ParseOutcome::Complete(reply, length) = parse::<ToHost>(bytes) else {
            panic!("{bytes:?} is not a frame")
        };
        assert_eq!(length, bytes.len());
        if reply.function == Function::Alarm {
            assert_eq!((reply.address, registers.get(OPTIONS.address) & option::ALARMS), (1, option::ALARMS));
            return;
        }
        assert!(matches!(reply.function, Function::Read | Function::Report));
        assert_eq!(reply.data, registers.read(reply.address, reply.count));
        assert!(registers.image() == self.settings, "a reply before the settings were saved");
        extended_block::check_reply(reply.address, reply.count, registers);
    }

    /// Checks a command to the servos. `positions` are the positions in the servos' last replies, in counts.
    pub fn command_to_servos(
        &mut self,
        now_us: u64,
        command: &ServoCommand,
        registers: &RegisterFile,
        positions: &[u16; 7],
    ) {
        match command {
            ServoCommand::Read(id, _) => assert!(*id < 7),
            ServoCommand::Torque(codes) => self.torque_command(codes, registers),
            ServoCommand::Goals(goals) => {
                assert_eq!(registers.get(MOTOR_STATE.address), motor_state::SERVO, "goals in state 0 or 2");
                self.linkage_goals(goals, registers, positions);
                for &(id, counts) in goals {
                    let position = positions.get(usize::from(id)).copied().unwrap_or(u16::MAX);
                    self.goal_command(now_us, id, counts, position, registers);
                }
            }
        }
    }

    fn torque_command(&mut self, codes: &[Option<u8>; 7], registers: &RegisterFile) {
        let is_servo = registers.get(MOTOR_STATE.address) == motor_state::SERVO;
        for ((joint, state), code) in Joint::ALL.iter().zip(&mut self.joints).zip(codes) {
            let Some(code) = *code else { continue };
            let on = code == self.config.torque_codes.code(Torque::On);
            assert_eq!(on, is_servo, "the torque does not match the motor state");
            assert!(!on || state.goal.is_some(), "{joint:?} is given torque without a goal");
            state.goal = state.goal.filter(|_| on);
            self.is_driven[usize::from(joint.index())] = on;
        }
        if self.is_driven != [false; 7] {
            self.released_at = None;
        }
    }

    /// Checks that the goals of joints 2 and 3 keep the linkage, while that limit is on (D25).
    fn linkage_goals(&mut self, goals: &[(u8, u16)], registers: &RegisterFile, positions: &[u16; 7]) {
        let [_, two, three, ..] = Joint::ALL;
        let offsets = [two, three].map(|joint| registers.offset(joint));
        // A new goal at the reported position means that the joint engages there.
        let engages = goals.iter().any(|&(id, counts)| {
            let index = usize::from(id);
            matches!(id, 1 | 2)
                && positions[index] == counts
                && self.joints[index].goal.is_none_or(|(last, ..)| last != counts)
        });
        let is_on = registers.get(LIMITS.address) & limit::LINKAGE != 0;
        if engages || !is_on || offsets != self.offsets {
            self.linkage.reset();
        }
        self.offsets = offsets;
        let goal =
            |wanted: Joint| goals.iter().find(|(id, _)| *id == wanted.index()).map(|(_, counts)| *counts);
        let check = self.linkage.check([goal(two), goal(three)], offsets);
        assert!(!is_on || check.is_ok(), "{check:?}");
    }

    /// Checks that the joint can reach the goal from its last goal in the time between them, or that the goal is at the joint's
    /// position.
    fn goal_command(&mut self, now_us: u64, id: u8, counts: u16, position: u16, registers: &RegisterFile) {
        let Some(joint) = Joint::from_index(id) else { panic!("there is no servo {id}") };
        assert_eq!(registers.get(MISSING_SERVOS.address) & joint.bit(), 0, "{joint:?} is missing");
        let state = &mut self.joints[usize::from(id)];
        let calls = self.calls;
        let is_near = |(before, at, call): (u16, u64, u32)| {
            // Two more cycles, because the controller may make up for a late cycle, and another cycle may end now. Each
            // cycle needs a poll.
            let cycles = ((now_us - at) / CYCLE_US + 2).min((calls - call).into());
            f64::from(before.abs_diff(counts)) <= state.max_speed * cycles as f64 + 2.0
        };
        let degrees = |MicroDegrees(micro)| f64::from(micro) / 1e6;
        let goal = degrees(angle_from_counts(joint, counts, registers.offset(joint)));
        let place = f64::from(registers.get(PRESENT_POSITION.of(joint)));
        // The register is rounded by up to 0.5 degrees, and a count is 0.3 degrees. After a change of the offset the
        // register keeps the old angle until the next reading, so the position in the last reply counts too.
        let is_here = (goal.clamp(0.0, 180.0) - place).abs() < 1.0 || counts == position;
        assert!(
            state.goal.is_some_and(is_near) || is_here,
            "{joint:?} jumps to {counts} from {:?}",
            state.goal
        );
        *state = JointGoal { goal: Some((counts, now_us, calls)), max_speed: max_speed(registers, joint) };
    }

    pub fn vacuum_switched(&mut self, now_us: u64, vacuum: Vacuum) {
        assert!(vacuum != self.vacuum && !(vacuum.pump && vacuum.valve));
        self.vacuum = vacuum;
        self.valve_opened_at = vacuum.valve.then_some(now_us);
    }

    pub fn saved(&mut self, settings: Image, storage: Storage) {
        (self.settings, self.storage) = (settings, storage);
    }

    /// Counts a poll, and keeps the highest speed limit of each joint since its last goal.
    pub fn after_poll(&mut self, registers: &RegisterFile) {
        self.calls += 1;
        for (joint, state) in Joint::ALL.into_iter().zip(&mut self.joints) {
            state.max_speed = state.max_speed.max(max_speed(registers, joint));
        }
    }

    /// Checks registers, valve and torque when the controller waits, and counts the poll.
    pub fn after_wait(&mut self, now_us: u64, registers: &RegisterFile) {
        self.after_poll(registers);
        // Offsets are not checked: after a write in map 2.1 they have the encoding of that map.
        let is_open = |row: &&Register| row.access == Access::ReadWrite && **row != OFFSET;
        for row in MAP.iter().filter(is_open) {
            for address in (row.address..).take(row.count.into()).step_by(row.range.width().into()) {
                let raw = if row.range.width() == 2 {
                    registers.word(address)
                } else {
                    registers.get(address).into()
                };
                assert!(row.range.contains(raw), "register {address}");
            }
        }
        let storage_fault = registers.get(FAULTS.address) & fault::SETTINGS_STORAGE != 0;
        assert!(storage_fault || self.storage == Storage::Ready);
        assert!(registers.get(EEPROM_LOCK.address) <= 1);
        assert!(self.valve_opened_at.is_none_or(|at| now_us - at < VALVE_TIME_US), "the valve is held open");
        self.check_release(now_us, registers);
    }

    /// Checks that torque is switched off within the servo timeout and 2 ms, once the motor state is not servo.
    fn check_release(&mut self, now_us: u64, registers: &RegisterFile) {
        if registers.get(MOTOR_STATE.address) == motor_state::SERVO {
            self.released_at = None;
            return;
        }
        let since = *self.released_at.get_or_insert(now_us);
        let free = since.saturating_add(self.config.servo_timeout.as_micros()).saturating_add(2_000);
        assert!(now_us < free || self.is_driven == [false; 7], "torque is still on");
    }
}

/// The speed limit of a joint in counts per cycle.
fn max_speed(registers: &RegisterFile, joint: Joint) -> f64 {
    match registers.get(SPEED.of(joint)) {
        0 => MAX_COUNTS,
        speed => f64::from(speed) * COUNTS_PER_SPEED,
    }
}
