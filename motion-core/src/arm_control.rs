//! The arm behind its host port: the effects of writes and of the servos' answers.
//!
//! ```text
//!   write ──▶ registers ──▶ Joints ──▶ BusScheduler ──▶ frame for the servos
//!                  ▲          ▲             │
//!      ControllerStatus ◀─────┴── outcome ◀─┘
//! ```
//!
//! A write is checked completely, then executed completely ([D15](protocol_core::decisions#d15) to
//! [D17](protocol_core::decisions#d17)). This file does not know the host's stream.

use protocol_core::registers::map::{
    FEEDBACK_FREQUENCY, FRAMES_ACCEPTED, FRAMES_CORRUPTED, HOST_WATCHDOG, LIMITS, MOTOR_STATE, PROTECTION,
    REPORT_CONTENT, SERVO_BUS_ERRORS, SET_POINT_PERIOD, SUPPLY_LOST, SUPPLY_VOLTAGE, VACUUM_PUMP,
    WATCHDOG_ACTION, fault, motor_state, refusal,
};
use protocol_core::registers::map21::{ANGLE_FEEDBACK_FREQUENCY, LOAD_FEEDBACK_FREQUENCY, OPTIONS, option};
use protocol_core::registers::{Accepted, Image, Joint, RegisterFile};
use protocol_core::request::Alarm;
use protocol_core::settings::Storage;
use protocol_core::time::Instant;

use crate::bus_scheduler::BusScheduler;
use crate::config::Config;
use crate::host_watchdog::HostWatchdog;
use crate::joint_state::Measured;
use crate::joints::Joints;
use crate::limit_check::LimitCheck;
use crate::motor_state::MotorState;
use crate::reach::{self, Reached};
use crate::servo_bus::{Answer, Outcome};
use crate::status::ControllerStatus;
use crate::vacuum::VacuumControl;

/// Registers, joints, servo bus, status and vacuum of one arm.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct ArmControl {
    pub(crate) registers: RegisterFile,
    pub(crate) bus: BusScheduler,
    pub(crate) vacuum: VacuumControl,
    joints: Joints,
    status: ControllerStatus,
    watchdog: HostWatchdog,
    /// The watchdog has to be checked, once in each control cycle.
    pub(crate) watchdog_is_due: bool,
    /// Changed settings that are not saved yet.
    pub(crate) to_save: Option<Image>,
    /// An alarm that has to be sent.
    pub(crate) alarm: Option<Alarm>,
}

impl ArmControl {
    /// An arm that was powered up at `now`.
    pub(crate) fn new(now: Instant, config: Config, stored: Option<&Image>, storage: Storage) -> Self {
        let mut registers = RegisterFile::new(config.chip_id, stored);
        let joints = Joints::new(MotorState::from_register(registers.get(MOTOR_STATE.address)));
        let status = ControllerStatus::new(storage, config.faults);
        status.show_faults(&mut registers, &joints);
        let (bus, vacuum) = (BusScheduler::new(now, &config), VacuumControl::default());
        Self {
            registers,
            bus,
            vacuum,
            joints,
            status,
            watchdog: HostWatchdog::OFF,
            watchdog_is_due: false,
            to_save: None,
            alarm: None,
        }
    }

    /// Processes the answers of the servos and their timeouts, and ends start-up when it is over.
    pub(crate) fn take_answers(&mut self, now: Instant) {
        while let Some(outcome) = self.bus.outcome(now) {
            self.take_outcome(now, outcome);
        }
        if self.bus.end_start_up(now, &self.joints) {
            self.show_servos();
        }
    }

    /// Begins a control cycle if one is due, and advances the set-points of the joints that take goals.
    pub(crate) fn advance(&mut self, now: Instant) {
        if let Some(end) = self.bus.cycle_due(now) {
            self.begin_cycle(now, end);
        }
    }

    // Not inlined, like other functions here: most polls do not call it, but if it were inlined, every poll would save the
    // CPU registers that it uses.
    #[inline(never)]
    fn begin_cycle(&mut self, now: Instant, end: Instant) {
        self.bus.begin_cycle(end);
        if self.joints.advance(now, end, &mut self.registers) {
            self.bus.goals_changed();
        }
        ControllerStatus::show_moving(&mut self.registers, &self.joints);
        self.watchdog_is_due = true;
    }

    #[inline(never)]
    fn take_outcome(&mut self, now: Instant, outcome: Outcome) {
        match outcome {
            Outcome::Measured { joint, answer, is_timely } => self.measured(now, joint, &answer, is_timely),
            Outcome::Failed { joint } => self.failed(now, joint),
        }
    }

    fn measured(&mut self, now: Instant, joint: Joint, answer: &Answer, is_timely: bool) {
        let may_engage = is_timely && !self.bus.is_starting();
        let outcome = self.joints.measured(now, joint, answer, may_engage, &mut self.registers);
        if !is_timely {
            self.joints.doubt(joint);
        }
        match outcome {
            Measured::Rejected => return,
            Measured::FellSilent => return self.show_servos(),
            Measured::Accepted | Measured::ServoChanged | Measured::TorqueLost | Measured::TurnedPast => {}
            Measured::Engaged => self.bus.joint_engaged(joint),
            Measured::TorqueDue { goals } => self.bus.torque_due_after(goals),
            Measured::Freed => self.bus.torque_changed(),
            Measured::SupplyLost => {
                self.registers.set(SUPPLY_LOST.address, 1);
                self.damp();
            }
        }
        self.registers.set(SUPPLY_VOLTAGE.address, answer.reading.voltage_decivolts);
        if outcome != Measured::Accepted {
            self.show_servos();
        }
    }

    fn failed(&mut self, now: Instant, joint: Joint) {
        if !self.bus.is_starting() {
            self.registers.increment(&SERVO_BUS_ERRORS);
        }
        if self.joints.failed(now, joint) {
            self.show_servos();
        }
    }

    /// Prepares the next frame for the servo bus. Returns whether there is one.
    pub(crate) fn prepare_servo_frame(&mut self, now: Instant) -> bool {
        self.bus.prepare_frame(now, &mut self.joints, &self.registers)
    }

    /// Executes a write of the host in map 2.2, or refuses it completely. Returns whether it may have changed the frequency
    /// or the content of reports.
    #[inline(never)]
    pub(crate) fn write(&mut self, now: Instant, address: u8, values: &[u8]) -> bool {
        let accepted = match self.registers.check(address, values) {
            Ok(accepted) => accepted,
            Err(refused) => return self.refuse(refused.reason, refused.address),
        };
        let Some(changes_settings) = self.check_storage(&accepted) else { return false };
        if let Some(address) = self.against_limit(&accepted, &Reached::NONE) {
            return self.refuse(refusal::AGAINST_A_LIMIT, address);
        }
        self.execute(now, &accepted, changes_settings);
        if accepted.is_extended() {
            self.execute_extended(now, &accepted);
        }
        let sets_frequency = accepted.value_at(FEEDBACK_FREQUENCY.address).is_some();
        if sets_frequency {
            self.stop_reports_of_map21();
        }
        sets_frequency || accepted.value_at(REPORT_CONTENT.address).is_some()
    }

    /// Executes a write of the host in map 2.1, or refuses it completely. `has_room` tells whether an alarm can be sent.
    /// Returns whether it may have changed a report frequency.
    #[inline(never)]
    pub(crate) fn write_map21(&mut self, now: Instant, address: u8, values: &[u8], has_room: bool) -> bool {
        let accepted = match self.registers.check_map21(address, values) {
            Ok(accepted) => accepted,
            Err(refused) => return self.refuse(refused.reason, refused.address),
        };
        let Some(changes_settings) = self.check_storage(&accepted) else { return false };
        let reached = match reach::targets(&accepted) {
            Ok(reached) => reached,
            Err(out_of_reach) => {
                let is_wanted = self.registers.get(OPTIONS.address) & option::ALARMS != 0;
                self.alarm = (is_wanted && has_room).then_some(out_of_reach.alarm);
                return self.refuse(refusal::OUT_OF_REACH, out_of_reach.address);
            }
        };
        if let Some(address) = self.against_limit(&accepted, &reached) {
            return self.refuse(refusal::AGAINST_A_LIMIT, address);
        }
        self.execute(now, &accepted, changes_settings);
        self.registers.set(FEEDBACK_FREQUENCY.address, 0);
        self.joints.reach(&reached, &mut self.registers);
        ControllerStatus::show_moving(&mut self.registers, &self.joints);
        true
    }

    fn against_limit(&self, accepted: &Accepted<'_>, reached: &Reached) -> Option<u8> {
        let limits = self.registers.get(LIMITS.address);
        let may_change = accepted.is_extended() && accepted.value_at(LIMITS.address).is_some();
        if limits == 0 && !may_change {
            return None;
        }
        self.joints.against_limit(&LimitCheck { accepted, reached, limits })
    }

    /// Refuses a write. Returns `false`, because a refused write does not change the reports.
    fn refuse(&mut self, reason: u8, address: u8) -> bool {
        ControllerStatus::refuse(&mut self.registers, reason, address);
        false
    }

    /// Returns whether a write changes settings. If it does and the storage is full, refuses it and returns `None`.
    fn check_storage(&mut self, accepted: &Accepted<'_>) -> Option<bool> {
        let changed_setting = self.registers.first_changed_setting(accepted);
        if let (Some(setting), Storage::Full) = (changed_setting, self.status.storage()) {
            self.refuse(refusal::STORAGE_FULL, setting);
            return None;
        }
        Some(changed_setting.is_some())
    }

    fn execute(&mut self, now: Instant, accepted: &Accepted<'_>, changes_settings: bool) {
        // The motor state comes before the rest of the frame, so that a target in it replaces the measured position (D13).
        self.set_motor_state(accepted);
        // A new period counts from the next point on (D23): points in the same frame still use the old one.
        let period = self.registers.word(SET_POINT_PERIOD.address);
        self.apply(accepted, changes_settings);
        self.joints.set_targets(now, accepted, period, &mut self.registers);
        if let Some(pump) = accepted.value_at(VACUUM_PUMP.address) {
            self.vacuum.set(now, pump != 0);
        }
        self.count_accepted();
        ControllerStatus::show_moving(&mut self.registers, &self.joints);
    }

    /// Applies the registers of the extended block and the protection block that act at once: watchdog and protection
    /// switch.
    fn execute_extended(&mut self, now: Instant, accepted: &Accepted<'_>) {
        if let Some(value) = accepted.value_at(HOST_WATCHDOG.address) {
            self.watchdog.set(now, value);
            self.status.clear_faults(fault::HOST_SILENT);
            self.status.show_faults(&mut self.registers, &self.joints);
        }
        if accepted.value_at(PROTECTION.address) == Some(0) {
            self.joints.forget_obstacles();
        }
    }

    /// Holds or damps the arm if the host was silent for too long ([D24](protocol_core::decisions#d24)). Returns whether it
    /// did.
    pub(crate) fn poll_watchdog(&mut self, now: Instant) -> bool {
        self.watchdog_is_due = false;
        if !self.watchdog.poll(now) {
            return false;
        }
        if self.registers.get(WATCHDOG_ACTION.address) == 0 {
            self.joints.hold(&mut self.registers);
        } else {
            self.damp();
        }
        ControllerStatus::show_moving(&mut self.registers, &self.joints);
        self.raise_faults(fault::HOST_SILENT);
        true
    }

    fn stop_reports_of_map21(&mut self) {
        self.registers.set(ANGLE_FEEDBACK_FREQUENCY.address, 0);
        self.registers.set(LOAD_FEEDBACK_FREQUENCY.address, 0);
    }

    /// Ends all reports, and forgets in which map the last write was ([M12](protocol_core::decisions#m12)).
    pub(crate) fn forget_host(&mut self) {
        self.registers.forget_last_write();
        self.registers.set(FEEDBACK_FREQUENCY.address, 0);
        self.stop_reports_of_map21();
    }

    fn set_motor_state(&mut self, accepted: &Accepted<'_>) {
        if let Some(value) = accepted.value_at(MOTOR_STATE.address) {
            self.registers.set(SUPPLY_LOST.address, 0);
            self.enter_state(MotorState::from_register(value));
            if self.joints.order() {
                self.bus.torque_changed();
            }
        }
    }

    /// Enters state 0 without a write of the host ([D24](protocol_core::decisions#d24), [D29](protocol_core::decisions#d29)).
    fn damp(&mut self) {
        self.registers.set(MOTOR_STATE.address, motor_state::DAMPING);
        self.enter_state(MotorState::Damping);
    }

    fn enter_state(&mut self, state: MotorState) {
        if self.joints.set_state(state, &mut self.registers) {
            self.bus.torque_changed();
        }
    }

    fn apply(&mut self, accepted: &Accepted<'_>, changes_settings: bool) {
        if !changes_settings {
            return self.registers.apply(accepted);
        }
        let offsets = Joint::ALL.map(|joint| self.registers.offset(joint));
        self.registers.apply(accepted);
        self.to_save = Some(self.registers.image());
        self.joints.rebase_offsets(&offsets, &self.registers);
    }

    /// Ends a silence of the host, because a well-formed frame had its turn at `now`.
    pub(crate) fn heard_host(&mut self, now: Instant) {
        self.watchdog.heard(now);
    }

    pub(crate) fn count_accepted(&mut self) {
        self.registers.increment(&FRAMES_ACCEPTED);
    }

    /// Counts a frame with a wrong CRC.
    pub(crate) fn count_corrupted(&mut self) {
        self.registers.increment(&FRAMES_CORRUPTED);
    }

    /// Refuses a frame whose range ends beyond address 255 ([D2](protocol_core::decisions#d2)).
    pub(crate) fn refuse_range(&mut self, address: u8) {
        ControllerStatus::refuse(&mut self.registers, refusal::MALFORMED_RANGE, address);
    }

    /// Sets the state of the settings storage.
    pub(crate) fn set_storage(&mut self, storage: Storage) {
        self.status.set_storage(storage);
        self.status.show_faults(&mut self.registers, &self.joints);
    }

    /// Raises fault bits. They stay until the next restart, but [`fault::HOST_SILENT`] only until register 186 is
    /// written.
    pub(crate) fn raise_faults(&mut self, bits: u8) {
        self.status.raise_faults(bits);
        self.status.show_faults(&mut self.registers, &self.joints);
    }

    /// Updates the registers of the extended block and the protection block. It is called only before they are sent.
    pub(crate) fn show_extended(&mut self) {
        self.joints.show_extended(&mut self.registers);
    }

    fn show_servos(&mut self) {
        self.status.show_servos(&mut self.registers, &self.joints, self.bus.is_starting());
    }

    /// When the next action of the arm is due.
    pub(crate) fn deadline(&self, now: Instant) -> Instant {
        self.bus.deadline(now).min(self.vacuum.deadline())
    }
}
