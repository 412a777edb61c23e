//! What must hold whatever happens: replies tell the registers, the arm never jumps and is never driven where it
//! must not be, the valve is never held, and the status block tells the truth.

use motion_core::calibration::{MicroDegrees, angle_from_counts};
use motion_core::servo_bus::Torque;
use motion_core::{Config, Storage, Vacuum};
use protocol_core::registers::map::{
    EEPROM_LOCK, FAULTS, MISSING_SERVOS, MOTOR_STATE, OFFSET, PRESENT_POSITION, SPEED, fault, motor_state,
};
use protocol_core::registers::{Access, Image, Joint, MAP, RegisterFile};
use protocol_core::wire::frame::{Function, ParseOutcome, ToHost, parse};

use super::servos::Command;

/// Counts of the largest step of a control cycle at a speed of 1, and at the motor's maximum: 0.019 and 3.72
/// degrees at 850 / 180 counts a degree.
const COUNTS_PER_SPEED: f64 = 0.019 * 850.0 / 180.0;
const MOST_COUNTS: f64 = 3.72 * 850.0 / 180.0;
const CYCLE_US: u64 = 10_000;
const VALVE_TIME_US: u64 = 500_000;

#[derive(Clone, Copy, Default)]
struct Joints {
    /// The goal that the servo follows, since when, and since how many calls; `None` while its torque is off.
    goal: Option<(u16, u64, u32)>,
    /// The fastest it may have been told to go since then, in counts a cycle.
    fastest: f64,
}

pub struct Watch {
    config: Config,
    storage: Storage,
    /// What the storage was last given.
    pub settings: Image,
    calls: u32,
    joints: [Joints; 7],
    is_driven: [bool; 7],
    /// Since when the motor state has been another than servo.
    released_at: Option<u64>,
    valve_opened_at: Option<u64>,
    vacuum: Vacuum,
}

impl Watch {
    pub fn new(config: Config, storage: Storage, registers: &RegisterFile) -> Self {
        Self {
            config,
            storage,
            settings: registers.image(),
            calls: 0,
            joints: [Joints::default(); 7],
            is_driven: [false; 7],
            released_at: None,
            valve_opened_at: None,
            vacuum: Vacuum::default(),
        }
    }

    /// Replies are whole frames, and tell the registers as they are.
    pub fn told_host(&self, bytes: &[u8], registers: &RegisterFile) {
        let ParseOutcome::Complete(reply, length) = parse::<ToHost>(bytes) else {
            panic!("{bytes:?} is not a frame")
        };
        assert!(length == bytes.len() && reply.function == Function::Read);
        assert_eq!(reply.data, registers.read(reply.address, reply.count));
        assert!(registers.image() == self.settings, "answered before the settings were saved");
    }

    /// `positions` are those of the servos' last answers, in counts.
    pub fn told_servos(
        &mut self,
        now_us: u64,
        command: &Command,
        registers: &RegisterFile,
        positions: &[u16; 7],
    ) {
        match command {
            Command::Ask(id, _) => assert!(*id < 7),
            Command::Torque(codes) => self.told_torque(codes, registers),
            Command::Goals(goals) => {
                assert_eq!(registers.get(MOTOR_STATE.address), motor_state::SERVO, "driven in state 0 or 2");
                for &(id, counts) in goals {
                    let position = positions.get(usize::from(id)).copied().unwrap_or(u16::MAX);
                    self.told_goal(now_us, id, counts, position, registers);
                }
            }
        }
    }

    fn told_torque(&mut self, codes: &[Option<u8>; 7], registers: &RegisterFile) {
        let is_servo = registers.get(MOTOR_STATE.address) == motor_state::SERVO;
        for ((joint, state), code) in Joint::ALL.iter().zip(&mut self.joints).zip(codes) {
            let Some(code) = *code else { continue };
            let on = code == self.config.torque_codes.code(Torque::On);
            assert_eq!(on, is_servo, "on in state 0 or 2, or freed in state 1");
            assert!(!on || state.goal.is_some(), "{joint:?} wakes up with an old goal");
            state.goal = state.goal.filter(|_| on);
            self.is_driven[usize::from(joint.index())] = on;
        }
        if self.is_driven != [false; 7] {
            self.released_at = None;
        }
    }

    /// A goal is within reach of the one before, or of where the joint is.
    fn told_goal(&mut self, now_us: u64, id: u8, counts: u16, position: u16, registers: &RegisterFile) {
        let Some(joint) = Joint::from_index(id) else { panic!("there is no servo {id}") };
        assert_eq!(registers.get(MISSING_SERVOS.address) & joint.bit(), 0, "{joint:?} is missing");
        let state = &mut self.joints[usize::from(id)];
        let calls = self.calls;
        let is_near = |(before, at, call): (u16, u64, u32)| {
            // A late cycle is made up for, and one may be over just now; but none without a call.
            let cycles = ((now_us - at) / CYCLE_US + 2).min((calls - call).into());
            f64::from(before.abs_diff(counts)) <= state.fastest * cycles as f64 + 2.0
        };
        let degrees = |MicroDegrees(micro)| f64::from(micro) / 1e6;
        let offset = OFFSET.range.decode(registers.get(OFFSET.of(joint)));
        let goal = degrees(angle_from_counts(joint, counts, i8::try_from(offset).unwrap()));
        let place = f64::from(registers.get(PRESENT_POSITION.of(joint)));
        // Half a degree is what the register rounds off, and a third of one is a count. After a change of the offset
        // the register keeps the old angle until the next measurement, so the last answer counts too.
        let is_here = (goal.clamp(0.0, 180.0) - place).abs() < 1.0 || counts == position;
        assert!(
            state.goal.is_some_and(is_near) || is_here,
            "{joint:?} jumps to {counts} from {:?}",
            state.goal
        );
        *state = Joints { goal: Some((counts, now_us, calls)), fastest: fastest(registers, joint) };
    }

    pub fn switched(&mut self, now_us: u64, vacuum: Vacuum) {
        assert!(vacuum != self.vacuum && !(vacuum.pump && vacuum.valve));
        self.vacuum = vacuum;
        self.valve_opened_at = vacuum.valve.then_some(now_us);
    }

    pub fn saved(&mut self, settings: Image, storage: Storage) {
        (self.settings, self.storage) = (settings, storage);
    }

    /// After every call.
    pub fn polled(&mut self, registers: &RegisterFile) {
        self.calls += 1;
        for (joint, state) in Joint::ALL.into_iter().zip(&mut self.joints) {
            state.fastest = state.fastest.max(fastest(registers, joint));
        }
    }

    /// Once there is nothing more to do for now.
    pub fn idle(&mut self, now_us: u64, registers: &RegisterFile) {
        self.polled(registers);
        for row in MAP.iter().filter(|row| row.access == Access::ReadWrite) {
            for address in (row.address..).take(row.count.into()) {
                assert!(row.range.contains(registers.get(address)), "register {address}");
            }
        }
        let storage_fault = registers.get(FAULTS.address) & fault::SETTINGS_STORAGE != 0;
        assert!(storage_fault || self.storage == Storage::Ready);
        assert!(registers.get(EEPROM_LOCK.address) <= 1);
        assert!(self.valve_opened_at.is_none_or(|at| now_us - at < VALVE_TIME_US), "the valve is held open");
        self.check_release(now_us, registers);
    }

    /// Torque goes as soon as the bus is free.
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

/// How many counts a joint may move in one cycle.
fn fastest(registers: &RegisterFile, joint: Joint) -> f64 {
    match registers.get(SPEED.of(joint)) {
        0 => MOST_COUNTS,
        speed => f64::from(speed) * COUNTS_PER_SPEED,
    }
}
