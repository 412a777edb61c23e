//! The arm: registers, seven joints, what a request means, and what the servo bus is to say next.
//!
//! The controller calls it with requests that are whole and with the time; it knows nothing of the host's
//! stream. It speaks to servos through the [`Bus`] and never waits for one.
//!
//! ```text
//!   mod      what the host writes
//!   servos   what the servos say, and what they are told
//!   status   what the arm shows of its own health
//! ```

mod servos;
mod status;

use protocol_core::registers::map::{
    BAUD_RATE, FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_REFUSED, LAST_REFUSAL, LAST_REFUSED_REGISTER,
    MOTOR_STATE, OFFSET, PRESENT_POSITION, TARGET_POSITION, TIME, VACUUM_PUMP, baud_rate, refusal,
};
use protocol_core::registers::{Accepted, Image, JOINTS, Joint, RegisterFile};
use protocol_core::time::{Duration, Instant};

use crate::calibration::{MicroDegrees, angle_from_counts, counts_from_angle};
use crate::controller::{Config, Storage};
use crate::drive::Drive;
use crate::feedback::Feedback;
use crate::mode::MotorState;
use crate::sensor::Sensor;
use crate::servo_bus::Bus;
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
}

impl JointState {
    const NEW: Self = Self { drive: Drive::RELEASED, sensor: Sensor::UNKNOWN, alarms: 0, temperature: 0 };
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
    /// The torque switches have to be set: a joint engaged or was lost, the mode changed, or it is time again.
    torque_due: bool,
    torque_refresh_in: u8,
    next_to_ask: Joint,
    /// How many servos' turns to be asked have not come in this cycle.
    left_to_ask: usize,
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
            torque_due: true,
            torque_refresh_in: TORQUE_REFRESH_CYCLES,
            next_to_ask: Joint::ALL[0],
            left_to_ask: 0,
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
        self.torque_due = true;
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
            self.feedback.set(now, frequency, self.baud);
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
}

/// A joint's offset in degrees.
fn offset(registers: &RegisterFile, joint: Joint) -> i8 {
    let degrees = OFFSET.range.decode(registers.get(OFFSET.of(joint)));
    i8::try_from(degrees).unwrap_or(0)
}
