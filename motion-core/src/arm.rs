//! The arm: registers, seven joints, what a request means, and what the servo bus is to say next.
//!
//! The controller calls it with requests that are whole and with the time; it knows nothing of the host's
//! stream. It speaks to servos through the [`Bus`] and never waits for one.

use protocol_core::registers::map::{
    BAUD_RATE, FAULTS, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL,
    LAST_REFUSED_REGISTER, MISSING_SERVOS, MOTOR_STATE, MOVING_JOINTS, OFFSET, PRESENT_POSITION,
    SERVO_BUS_ERRORS, SERVO_TEMPERATURE, SPEED, SUPPLY_VOLTAGE, TARGET_POSITION, TIME, VACUUM_PUMP,
    baud_rate, fault, refusal,
};
use protocol_core::registers::{Accepted, Image, JOINTS, Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use crate::CYCLE;
use crate::calibration::{MicroDegrees, angle_from_counts, counts_from_angle};
use crate::controller::{Config, Storage};
use crate::drive::{Drive, Engaged};
use crate::feedback::Feedback;
use crate::mode::MotorState;
use crate::sensor::Sensor;
use crate::servo_bus::{Bus, Outcome, Reading, Torque};
use crate::vacuum::Gripper;

/// How long the servos may take after power-up until those that have not answered are given up for now.
/// Real ones take about 200 ms.
const START_UP_TIME: Duration = Duration::from_millis(500);
/// Every so many control cycles the torque switches are set again, in case a frame was lost.
const TORQUE_REFRESH_CYCLES: u8 = 25;

/// One joint's part of the arm.
#[derive(Clone, Copy, Debug)]
struct JointState {
    drive: Drive,
    sensor: Sensor,
    /// The servo's complaints in its last answer.
    alarms: u8,
    /// In degrees Celsius; 0 while unknown.
    temperature: u8,
    asked_this_cycle: bool,
}

impl JointState {
    const NEW: Self = Self {
        drive: Drive::RELEASED,
        sensor: Sensor::UNKNOWN,
        alarms: 0,
        temperature: 0,
        asked_this_cycle: false,
    };
}

/// The arm.
#[derive(Debug)]
pub struct Arm {
    pub(crate) registers: RegisterFile,
    pub(crate) gripper: Gripper,
    pub(crate) feedback: Feedback,
    pub(crate) bus: Bus,
    baud: u32,
    joints: [JointState; JOINTS],
    mode: MotorState,
    /// Until when servos may be silent because they are starting up; `None` once that is over.
    starting_until: Option<Instant>,
    next_cycle: Instant,
    goals_due: bool,
    /// What the torque switches were last set to; `None` if they have to be set again.
    torque_set: Option<[Torque; JOINTS]>,
    torque_refresh_in: u8,
    next_to_ask: Joint,
    storage: Storage,
    /// Fault bits that stay until the next restart.
    lasting_faults: u8,
    pub(crate) to_save: Option<Image>,
}

impl Arm {
    pub(crate) fn new(now: Instant, config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        let registers = RegisterFile::new(config.chip_id, stored);
        let mut arm = Self {
            baud: baud_rate(registers.get(BAUD_RATE.address)),
            mode: MotorState::from_register(registers.get(MOTOR_STATE.address)),
            registers,
            gripper: Gripper::default(),
            feedback: Feedback::OFF,
            bus: Bus::new(config.servo_timeout, config.torque_codes),
            joints: [JointState::NEW; JOINTS],
            starting_until: Some(now + START_UP_TIME),
            next_cycle: now,
            goals_due: false,
            torque_set: None,
            torque_refresh_in: TORQUE_REFRESH_CYCLES,
            next_to_ask: Joint::ALL[0],
            storage,
            lasting_faults: config.faults,
            to_save: None,
        };
        arm.joints.iter_mut().for_each(|joint| joint.drive.wait());
        arm.show_faults();
        arm
    }

    /// The host link's baud rate in force since start, in bits per second.
    pub(crate) const fn baud(&self) -> u32 {
        self.baud
    }

    // What the host writes.

    /// Carries out a write of the host, or refuses it whole.
    pub(crate) fn write(&mut self, now: Instant, address: u8, values: &[u8]) {
        let accepted = match self.registers.check(address, values) {
            Ok(accepted) => accepted,
            Err(wrong) => return self.refuse(refusal::OUT_OF_RANGE, wrong.address),
        };
        let changed_setting = self.registers.first_changed_setting(&accepted);
        if let (Some(setting), Storage::Full) = (changed_setting, self.storage) {
            return self.refuse(refusal::STORAGE_FULL, setting);
        }
        self.change_mode(&accepted);
        let offsets = Joint::ALL.map(|joint| offset(&self.registers, joint));
        self.registers.apply(&accepted);
        if changed_setting.is_some() {
            self.to_save = Some(self.registers.image());
            self.rename_places(&offsets);
        }
        self.aim(&accepted);
        self.switch(now, &accepted);
        self.registers.increment(&FRAMES_ACCEPTED);
    }

    /// Counts a refused frame and shows why.
    pub(crate) fn refuse(&mut self, reason: u8, address: u8) {
        self.registers.increment(&FRAMES_REFUSED);
        self.registers.set(LAST_REFUSAL.address, reason);
        self.registers.set(LAST_REFUSED_REGISTER.address, address);
    }

    /// Enters or leaves the servo state. Comes before the rest of the frame takes effect, so that a target
    /// in the same frame wins over the measured position (D13).
    fn change_mode(&mut self, accepted: &Accepted<'_>) {
        let Some(value) = accepted.value_at(MOTOR_STATE.address) else { return };
        let mode = MotorState::from_register(value);
        if mode == self.mode {
            return;
        }
        self.mode = mode;
        for (joint, state) in Joint::ALL.into_iter().zip(&mut self.joints) {
            if mode != MotorState::Servo {
                state.drive.release();
                continue;
            }
            state.drive.wait();
            if state.sensor.is_known() {
                let present = self.registers.get(PRESENT_POSITION.of(joint));
                self.registers.set(TARGET_POSITION.of(joint), present);
            }
        }
        self.show_moving();
    }

    fn aim(&mut self, accepted: &Accepted<'_>) {
        for (joint, state) in Joint::ALL.into_iter().zip(&mut self.joints) {
            if let Some(degrees) = accepted.value_at(TARGET_POSITION.of(joint)) {
                let time = self.registers.get(TIME.of(joint));
                state.drive.aim(MicroDegrees::from_degrees(degrees), time);
            }
        }
        self.show_moving();
    }

    fn switch(&mut self, now: Instant, accepted: &Accepted<'_>) {
        if let Some(pump) = accepted.value_at(VACUUM_PUMP.address) {
            self.gripper.set(now, pump != 0);
        }
        if let Some(frequency) = accepted.value_at(FEEDBACK_FREQUENCY.address) {
            self.feedback = Feedback::new(now, frequency, self.baud);
        }
    }

    /// Where an offset changed, the joint did not move, but its place has another name now (D9). It goes to
    /// its target, by the new name, at its speed.
    fn rename_places(&mut self, offsets_before: &[i8; JOINTS]) {
        for ((joint, state), &before) in Joint::ALL.into_iter().zip(&mut self.joints).zip(offsets_before) {
            let offset = offset(&self.registers, joint);
            if offset != before {
                let counts = counts_from_angle(joint, state.drive.set_point(), before);
                let target = MicroDegrees::from_degrees(self.registers.get(TARGET_POSITION.of(joint)));
                let place = angle_from_counts(joint, counts, offset);
                state.drive.rename_place(place, target, self.registers.get(TIME.of(joint)));
            }
        }
    }

    // What the servos say.

    /// Takes in what the servos answered by `now`, and moves all set-points when a control cycle is due.
    pub(crate) fn advance(&mut self, now: Instant) {
        while let Some(outcome) = self.bus.poll(now) {
            match outcome {
                Outcome::Measured { joint, reading, alarms } => self.measured(now, joint, reading, alarms),
                Outcome::Failed { joint } => self.failed(now, joint),
            }
        }
        self.end_start_up(now);
        if now >= self.next_cycle {
            self.cycle(now);
        }
    }

    fn measured(&mut self, now: Instant, joint: Joint, reading: Reading, alarms: u8) {
        let offset = offset(&self.registers, joint);
        let starting = self.starting_until.is_some();
        let Some(state) = self.joints.get_mut(usize::from(joint.index())) else { return };
        let Some(counts) = state.sensor.answered(now, reading.position_counts) else { return };
        let angle = angle_from_counts(joint, counts, offset);
        state.alarms = alarms;
        state.temperature = reading.temperature_celsius;
        let engaged = if starting { None } else { state.drive.engage(angle) };
        self.registers.set(PRESENT_POSITION.of(joint), angle.nearest_degree());
        if engaged == Some(Engaged::Holding) {
            self.registers.set(TARGET_POSITION.of(joint), angle.nearest_degree());
        }
        self.goals_due |= engaged.is_some();
        self.registers.set(SUPPLY_VOLTAGE.address, reading.voltage_decivolts);
        self.show_servos();
    }

    fn failed(&mut self, now: Instant, joint: Joint) {
        if self.starting_until.is_none() {
            self.registers.increment(&SERVO_BUS_ERRORS);
        }
        let Some(state) = self.joints.get_mut(usize::from(joint.index())) else { return };
        if state.sensor.failed(now) {
            state.drive.lose();
            state.temperature = 0;
            state.alarms = 0;
            self.show_servos();
        }
    }

    /// Start-up is over once every joint is measured, or once the rest was waited for long enough.
    fn end_start_up(&mut self, now: Instant) {
        let Some(deadline) = self.starting_until else { return };
        if now >= deadline || self.joints.iter().all(|joint| joint.sensor.is_known()) {
            self.starting_until = None;
            self.show_servos();
        }
    }

    // What the servos are told.

    fn cycle(&mut self, now: Instant) {
        // One cycle may be made up for; more than that, and motion is late rather than fast.
        self.next_cycle = self.next_cycle.max(earlier(now, CYCLE)) + CYCLE;
        for (joint, state) in Joint::ALL.into_iter().zip(&mut self.joints) {
            state.asked_this_cycle = false;
            if state.drive.is_engaged() {
                state.drive.advance(self.registers.get(SPEED.of(joint)));
                self.goals_due = true;
            }
        }
        self.show_moving();
        self.torque_refresh_in = self.torque_refresh_in.saturating_sub(1);
        if self.torque_refresh_in == 0 {
            self.torque_set = None;
        }
    }

    /// Prepares the next frame for the servo bus, if there is one and the bus is idle. Goals go before
    /// torque, so that no servo wakes up with an old goal.
    pub(crate) fn command_servos(&mut self, now: Instant) -> bool {
        if !self.bus.is_idle(now) {
            return false;
        }
        if core::mem::take(&mut self.goals_due) && self.send_goals(now) {
            return true;
        }
        self.send_torque(now) || self.ask(now)
    }

    fn send_goals(&mut self, now: Instant) -> bool {
        let Self { joints, registers, bus, .. } = self;
        let engaged = || Joint::ALL.into_iter().zip(&*joints).filter(|(_, state)| state.drive.is_engaged());
        let goal = |(joint, state): (Joint, &JointState)| {
            (joint, counts_from_angle(joint, state.drive.set_point(), offset(registers, joint)))
        };
        let any = engaged().next().is_some();
        if any {
            bus.set_goals(now, engaged().map(goal));
        }
        any
    }

    fn send_torque(&mut self, now: Instant) -> bool {
        let torque = self.joints.map(|joint| self.mode.torque(joint.drive.is_engaged()));
        if self.torque_set == Some(torque) {
            return false;
        }
        self.bus.set_torque(now, &torque);
        self.torque_set = Some(torque);
        self.torque_refresh_in = TORQUE_REFRESH_CYCLES;
        true
    }

    /// Asks the next servo that was not asked in this cycle.
    fn ask(&mut self, now: Instant) -> bool {
        for _ in 0..JOINTS {
            let joint = self.next_to_ask;
            self.next_to_ask = Joint::from_index(joint.index() + 1).unwrap_or(Joint::ALL[0]);
            let Some(state) = self.joints.get_mut(usize::from(joint.index())) else { continue };
            if !state.asked_this_cycle && state.sensor.wants_asking(now) {
                state.asked_this_cycle = true;
                self.bus.ask(now, joint);
                return true;
            }
        }
        false
    }

    /// When the arm has something to do by itself.
    pub(crate) fn deadline(&self, now: Instant) -> Instant {
        let bus = if self.bus.is_idle(now) { Instant::FAR_FUTURE } else { self.bus.busy_until() };
        self.next_cycle.min(bus).min(self.gripper.deadline()).min(self.feedback.due())
    }

    // What the status block shows.

    /// What became of the settings storage.
    pub(crate) fn set_storage(&mut self, storage: Storage) {
        self.storage = storage;
        self.show_faults();
    }

    /// Raises fault bits until the next restart.
    pub(crate) fn raise_faults(&mut self, bits: u8) {
        self.lasting_faults |= bits;
        self.show_faults();
    }

    fn show_moving(&mut self) {
        let moving = self.joint_set(|joint| joint.drive.is_moving());
        self.registers.set(MOVING_JOINTS.address, moving);
    }

    fn show_servos(&mut self) {
        let starting = self.starting_until.is_some();
        let missing = self.joint_set(|joint| !starting && !joint.sensor.is_known());
        self.registers.set(MISSING_SERVOS.address, missing);
        let hottest = self.joints.iter().map(|joint| joint.temperature).max().unwrap_or(0);
        self.registers.set(SERVO_TEMPERATURE.address, hottest);
        if missing == 0x7F {
            self.registers.set(SUPPLY_VOLTAGE.address, 0);
        }
        self.show_moving();
        self.show_faults();
    }

    fn show_faults(&mut self) {
        let storage = if self.storage == Storage::Ready { 0 } else { fault::SETTINGS_STORAGE };
        let missing = self.registers.get(MISSING_SERVOS.address) != 0;
        let alarmed = self.joints.iter().any(|joint| joint.alarms != 0);
        let servos = if missing || alarmed { fault::SERVO_BUS } else { 0 };
        self.registers.set(FAULTS.address, self.lasting_faults | storage | servos);
    }

    fn joint_set(&self, belongs: impl Fn(&JointState) -> bool) -> u8 {
        let members = Joint::ALL.into_iter().zip(&self.joints).filter(|(_, state)| belongs(state));
        members.fold(0, |bits, (joint, _)| bits | joint.bit())
    }
}

/// A joint's offset in degrees.
fn offset(registers: &RegisterFile, joint: Joint) -> i8 {
    let degrees = OFFSET.range.decode(registers.get(OFFSET.of(joint)));
    i8::try_from(degrees).unwrap_or(0)
}

fn earlier(now: Instant, by: Duration) -> Instant {
    Instant::from_micros(now.as_micros().saturating_sub(by.as_micros()))
}
