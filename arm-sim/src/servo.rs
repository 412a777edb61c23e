//! A simulated servo: its registers, motor, temperature and faults.
//!
//! ```text
//!   frame ──▶ ServoRegisters ── goal, torque switch ──▶ Motor ◀── weight
//!   answer ◀──      ▲                                     │
//!                   └──── position, speed, load ──────────┘
//! ```
//!
//! Time passes in steps of a millisecond. The servo knows neither the timing of the wire nor other servos. The parameters
//! of its motor, gear and temperature are in `parameters.rs`.

mod config;
mod fault;
mod fault_state;
mod gear;
mod motor;
mod obstacles;
mod outside;
mod protection;
mod registers;
mod steps;
pub(crate) mod surroundings;
mod temperature;
pub(crate) mod units;

use motion_core::servo_bus::Torque;
use motion_core::servo_bus::frame::{Instruction, ServoFrame, ServoFrameBuffer};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

use crate::fault_count::FaultCount;
use crate::parameters::ServoParameters;
pub use config::ServoConfig;
pub use fault::{ServoFault, UnknownFault};
use fault_state::FaultState;
use motor::Motor;
pub use obstacles::Trip;
use protection::Protection;
use registers::ServoRegisters;
use temperature::Temperature;

/// The answer of a servo to a frame, from [`Servo::handle_frame`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoAnswer {
    /// The delay of the answer in addition to [`ServoConfig::return_delay`].
    pub delay: Duration,
    /// The frame. [`ServoFault::Garbled`] may have damaged it.
    pub bytes: ServoFrameBuffer,
}

/// The servo of one joint: its registers, motor, protection, temperature and fault.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Servo {
    config: ServoConfig,
    registers: ServoRegisters,
    motor: Motor,
    fault: FaultState,
    /// The servo executes no frame before this time. [`Instant::FAR_FUTURE`] without supply.
    ready_at: Instant,
    /// The torque switch is on.
    is_on: bool,
    /// A hand holds the joint until it has torque.
    is_held: bool,
    /// A stand holds the joint whenever it has no torque.
    is_supported: bool,
    protection: Protection,
    temperature: Temperature,
    /// Milliseconds in which the joint touched its wall.
    wall_count: FaultCount,
    /// Milliseconds in which the claws touched the thing between them.
    thing_count: FaultCount,
    /// Milliseconds in which the joint was pushed.
    push_count: FaultCount,
    /// The reported values of the last step that changed the servo. `None`: no step did so since the start.
    reported: Option<Reported>,
    /// The registers hold the measurements of an earlier step: [`Servo::update_reading`] updates them.
    is_reading_old: bool,
}

/// The values that a servo reports besides the measurements of its motor: supply, temperature and error bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Reported {
    decivolts: u8,
    celsius: u8,
    errors: u8,
}

impl Servo {
    /// The servo of a joint, with the joint's id. A hand holds the joint. The servo executes frames from `ready_at` on.
    #[must_use]
    pub fn new(joint: Joint, config: ServoConfig, position_counts: u16, ready_at: Instant) -> Self {
        Self {
            config,
            registers: ServoRegisters::new(joint.index()),
            motor: Motor::new(joint, position_counts),
            fault: FaultState::new(),
            ready_at,
            is_on: false,
            is_held: true,
            is_supported: false,
            protection: Protection::default(),
            temperature: Temperature::default(),
            wall_count: FaultCount::default(),
            thing_count: FaultCount::default(),
            push_count: FaultCount::default(),
            reported: None,
            is_reading_old: false,
        }
    }

    /// Switches power off and on. Torque, goal, all RAM registers and a latched overload are lost. [`ServoFault::Garbled`] counts
    /// the answers from the start again.
    pub fn power_cycle(&mut self, ready_at: Instant) {
        self.registers.power_cycle();
        self.ready_at = ready_at;
        self.is_on = false;
        self.protection.release();
        self.fault.start();
        (self.reported, self.is_reading_old) = (None, false);
    }

    /// Sets the id. All other registers get their factory settings.
    pub fn set_id(&mut self, id: u8) {
        self.registers = ServoRegisters::new(id);
        (self.reported, self.is_reading_old) = (None, false);
    }

    /// The id on the servo bus.
    #[must_use]
    pub fn id(&self) -> u8 {
        self.registers.id()
    }

    /// The baud rate in bits per second. The caller must not pass frames that were sent at another rate.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.registers.baud()
    }

    /// Sets or removes a fault at `now`. If this restores the power, the servo executes frames from `ready_at` on.
    pub fn set_fault(&mut self, now: Instant, fault: Option<ServoFault>, ready_at: Instant) {
        let was_missing = self.fault.is_missing();
        self.fault.set(now, fault);
        if was_missing != self.fault.is_missing() {
            self.power_cycle(ready_at);
        }
    }

    /// How often the fault took effect since it was set.
    #[must_use]
    pub const fn fault_count(&self) -> FaultCount {
        self.fault.count()
    }

    /// Changes the configuration from now on. Registers and motion of the servo stay as they are.
    pub const fn set_config(&mut self, config: ServoConfig) {
        self.config = config;
    }

    /// Changes the stall torque, the friction and the drag. See [`Motor::set_parameters`].
    pub(crate) fn set_parameters(&mut self, parameters: &ServoParameters) {
        self.motor.set_parameters(parameters);
    }

    /// Is a frame for this servo, or for all servos?
    pub(crate) fn is_addressed_by(&self, frame: &ServoFrame<'_>) -> bool {
        self.registers.is_addressed_by(frame)
    }

    /// Executes a frame at `now`, and returns the answer if there is one.
    pub fn handle_frame(&mut self, now: Instant, frame: &ServoFrame<'_>) -> Option<ServoAnswer> {
        if !self.is_addressed_by(frame) {
            return None;
        }
        self.fault.count_frame();
        if !self.has_power(now) {
            return None;
        }
        self.update_reading();
        let answer = self.registers.handle_frame(frame);
        self.apply_registers();
        answer.map(|mut bytes| ServoAnswer { delay: self.fault.inject(&mut bytes), bytes })
    }

    /// Does a frame have no effect on the next steps? True for a question, and for a sync write of values that a servo with torque
    /// already holds.
    pub(crate) fn is_unchanged_by(&self, frame: &ServoFrame<'_>) -> bool {
        let holds_values = || self.registers.holds(frame) && self.motor.is_started(self.registers.goal());
        self.is_on == self.is_switched_on()
            && match Instruction::from_code(frame.code) {
                Some(Instruction::Ping | Instruction::Read) => true,
                _ => self.is_on && holds_values(),
            }
    }

    fn apply_registers(&mut self) {
        let goal = self.registers.take_new_goal();
        if goal.is_some() && self.config.goal_starts_torque && !self.registers.is_torque_written() {
            self.registers.set_torque_switch(self.config.torque_codes.code(Torque::On));
        }
        self.apply_torque_switch();
        if let Some(goal) = goal {
            self.motor.start(goal);
        }
    }

    fn apply_torque_switch(&mut self) {
        let is_on = self.is_switched_on();
        if is_on && !self.is_on {
            self.is_held = false;
            self.motor.stop();
            self.motor.start(self.registers.goal());
        }
        if !is_on {
            self.protection.release();
        }
        self.is_on = is_on;
    }

    fn is_switched_on(&self) -> bool {
        self.registers.torque_switch() == self.config.torque_codes.code(Torque::On)
    }

    /// The setting of the torque switch. [`Torque::Free`] stands for each code that means neither on nor damping.
    #[must_use]
    pub fn torque_switch(&self) -> Torque {
        let code = self.registers.torque_switch();
        let has_code = |torque: &Torque| self.config.torque_codes.code(*torque) == code;
        [Torque::On, Torque::Damping].into_iter().find(has_code).unwrap_or(Torque::Free)
    }

    /// The torque of the motor at `now`. `None` without power, and while an alarm switches off a motor whose torque switch is on.
    #[must_use]
    pub fn torque(&self, now: Instant) -> Option<Torque> {
        let switch = self.torque_switch();
        // An alarm switches off the voltage of the motor. Damping needs no voltage, so it stays on (assumed).
        let is_freed = switch == Torque::On && self.protection.is_unloaded();
        (self.has_power(now) && !is_freed).then_some(switch)
    }

    /// Has the servo power, and has it started?
    pub(crate) fn has_power(&self, now: Instant) -> bool {
        now >= self.ready_at && !self.fault.is_missing()
    }

    /// The current in 0.1 % of the current of a stalled motor. It is proportional to the magnitude of the torque.
    #[must_use]
    pub fn current(&self) -> u16 {
        self.motor.torque().unsigned_abs().min(1_000)
    }

    /// The torque of the motor in 0.1 % of its stall torque. Positive values are towards more counts.
    #[must_use]
    pub(crate) fn motor_torque(&self) -> i16 {
        self.motor.torque()
    }

    /// The load in 0.1 %. Positive values are towards more counts.
    pub(crate) fn signed_load(&self) -> i16 {
        self.motor.load()
    }

    /// See [`Motor::droop`].
    pub(crate) fn droop(&self) -> Option<i64> {
        self.motor.droop()
    }

    /// See [`Motor::stopping_distance`].
    pub(crate) fn stopping_distance(&self) -> i64 {
        self.motor.stopping_distance()
    }

    /// The goal in its registers, in counts, within the limits of its EEPROM.
    #[must_use]
    pub fn goal_counts(&self) -> u16 {
        self.registers.goal().position_counts
    }

    /// The position in counts, 0 to 1023.
    #[must_use]
    pub fn position_counts(&self) -> u16 {
        self.motor.position_counts()
    }

    /// Does the servo drive its joint? `false` without torque or power, and while an alarm switches the motor off.
    #[must_use]
    pub const fn has_torque(&self) -> bool {
        self.is_on && !self.protection.is_unloaded()
    }

    /// The position in millionths of a count.
    pub(crate) const fn position(&self) -> i64 {
        self.motor.position()
    }

    /// Turns the joint by hand to a position in counts, and holds it there. A servo with torque turns back.
    pub fn move_by_hand(&mut self, counts: u16) {
        self.update_reading();
        self.motor.turn_to(counts);
        self.hold_by_hand(true);
    }

    /// Sets whether a hand holds the joint until it has torque. A joint with torque cannot be held.
    pub const fn hold_by_hand(&mut self, is_held: bool) {
        self.is_held = is_held && !self.is_on;
    }

    /// Does a hand hold the joint?
    pub(crate) const fn is_held(&self) -> bool {
        self.is_held
    }

    /// Sets whether a stand holds the joint whenever it has no torque.
    pub const fn support(&mut self, is_supported: bool) {
        self.is_supported = is_supported;
    }
}
