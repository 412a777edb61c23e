//! A simulated servo: its registers, motor, temperature and faults.
//!
//! ```text
//!   frame ──▶ ServoRegisters ── goal, torque switch ──▶ Motor ◀── weight
//!   answer ◀──      ▲                                     │
//!                   └──── position, speed, load ──────────┘
//! ```
//!
//! Time passes in steps of a millisecond. The servo does not know the timing of the wire or other servos. Voltage,
//! temperature and load are plausible values: no servo was measured.

mod config;
mod fault;
mod gear;
mod motor;
mod registers;
mod temperature;
pub(crate) mod units;

use motion_core::servo_bus::frame::{ServoFrame, ServoFrameBuffer, error};
use motion_core::servo_bus::{Reading, Torque};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

pub use config::ServoConfig;
pub use fault::{ServoFault, UnknownFault};
use gear::Drag;
use motor::{Motor, MotorMode};
use registers::ServoRegisters;
use temperature::Temperature;
use units::STEP;

/// A load above this, in 0.1 %, is an overload.
const OVERLOAD: u16 = 800;
/// After this many steps of overload a servo turns its motor off, until torque is switched off and on.
const OVERLOAD_STEPS: u32 = 1_000;

/// An answer of a servo.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The answer is sent this much later than [`ServoConfig::return_delay`] requires.
    pub delay: Duration,
    /// The frame.
    pub bytes: ServoFrameBuffer,
}

/// A servo.
#[derive(Clone, Debug)]
pub struct Servo {
    config: ServoConfig,
    registers: ServoRegisters,
    motor: Motor,
    fault: Option<ServoFault>,
    /// It executes no frame before this time.
    ready_at: Instant,
    /// When [`ServoFault::Restarting`] restarts it.
    restarts_at: Instant,
    /// The torque switch is on.
    is_on: bool,
    /// A hand holds it until it has torque.
    is_held: bool,
    /// A stand holds it whenever it has no torque.
    is_supported: bool,
    /// It turned its motor off after an overload.
    is_overloaded: bool,
    /// Number of successive steps with an overload.
    overload_steps: u32,
    /// Number of answers since its start.
    answers: u32,
    temperature: Temperature,
    /// What the registers hold, apart from the measurements of the motor.
    reported: Option<Reported>,
}

/// What a servo reports apart from the measurements of its motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Reported {
    decivolts: u8,
    celsius: u8,
    is_overloaded: bool,
}

impl Servo {
    /// The servo of a joint, with the joint's id. It is held by a hand and starts until `ready_at`.
    #[must_use]
    pub fn new(joint: Joint, config: ServoConfig, position_counts: u16, ready_at: Instant) -> Self {
        Self {
            config,
            registers: ServoRegisters::new(joint.index()),
            motor: Motor::new(joint, position_counts),
            fault: None,
            ready_at,
            restarts_at: Instant::FAR_FUTURE,
            is_on: false,
            is_held: true,
            is_supported: false,
            is_overloaded: false,
            overload_steps: 0,
            answers: 0,
            temperature: Temperature::default(),
            reported: None,
        }
    }

    /// Switches power off and on. Position, temperature, fault, EEPROM and the hand stay; everything else is lost.
    pub fn power_cycle(&mut self, ready_at: Instant) {
        self.registers.power_cycle();
        self.ready_at = ready_at;
        self.is_on = false;
        self.is_overloaded = false;
        self.overload_steps = 0;
        self.answers = 0;
        self.reported = None;
    }

    /// Sets the id. All other registers get their factory settings.
    pub fn set_id(&mut self, id: u8) {
        self.registers = ServoRegisters::new(id);
        self.reported = None;
    }

    /// The id.
    #[must_use]
    pub fn id(&self) -> u8 {
        self.registers.id()
    }

    /// The baud rate in bits per second. The caller passes no frames of another rate.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.registers.baud()
    }

    /// Sets or removes a fault at `now`. `ready_at` is used if this removes or restores the power.
    pub fn set_fault(&mut self, now: Instant, fault: Option<ServoFault>, ready_at: Instant) {
        let was_missing = self.is_missing();
        self.fault = fault;
        self.restarts_at = next_restart(now, fault);
        if was_missing != self.is_missing() {
            self.power_cycle(ready_at);
        }
    }

    /// Changes the configuration.
    pub const fn set_config(&mut self, config: ServoConfig) {
        self.config = config;
    }

    /// Executes a frame that ends at `now`, and returns the answer if there is one.
    pub fn handle_frame(&mut self, now: Instant, frame: &ServoFrame<'_>) -> Option<Answer> {
        if !self.registers.is_addressed_by(frame) || !self.has_power(now) {
            return None;
        }
        let answer = self.registers.handle_frame(frame);
        self.apply_registers();
        answer.map(|bytes| self.inject_fault(bytes))
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
        let is_on = self.torque_switch() == Torque::On;
        if is_on && !self.is_on {
            self.is_held = false;
            self.motor.stop();
            self.motor.start(self.registers.goal());
        }
        if !is_on {
            self.is_overloaded = false;
            self.overload_steps = 0;
        }
        self.is_on = is_on;
    }

    /// The setting of the torque switch.
    #[must_use]
    pub fn torque_switch(&self) -> Torque {
        let code = self.registers.torque_switch();
        let has_code = |torque: &Torque| self.config.torque_codes.code(*torque) == code;
        [Torque::On, Torque::Damping].into_iter().find(has_code).unwrap_or(Torque::Free)
    }

    /// The torque of the motor at `now`. `None` without power, and after an overload.
    #[must_use]
    pub fn torque(&self, now: Instant) -> Option<Torque> {
        (self.has_power(now) && !self.is_overloaded).then(|| self.torque_switch())
    }

    fn has_power(&self, now: Instant) -> bool {
        now >= self.ready_at && !self.is_missing()
    }

    fn is_missing(&self) -> bool {
        self.fault == Some(ServoFault::Missing)
    }

    fn inject_fault(&mut self, mut bytes: ServoFrameBuffer) -> Answer {
        self.answers = self.answers.wrapping_add(1);
        let mut delay = Duration::ZERO;
        match self.fault {
            Some(ServoFault::Late(by)) => delay = by,
            Some(ServoFault::Garbled(every)) if self.answers.is_multiple_of(every) => {
                bytes.last_mut().into_iter().for_each(|checksum| *checksum ^= 0x55);
            }
            _ => {}
        }
        Answer { delay, bytes }
    }

    /// Simulates the millisecond that ends at `now`, with this supply voltage. Returns whether the servo turned.
    pub fn step(&mut self, now: Instant, supply_decivolts: u8) -> bool {
        if now >= self.restarts_at {
            self.power_cycle(now + self.config.boot_time);
            self.restarts_at = next_restart(now, self.fault);
        }
        self.temperature.steps(self.load(), 1);
        let mode = self.motor_mode(now);
        if self.is_at_rest(mode, supply_decivolts) {
            // Most steps change nothing.
            self.overload_steps = 0;
            return false;
        }
        let before = self.motor.position();
        self.motor.step(mode);
        self.check_overload();
        self.update_registers(supply_decivolts);
        before != self.motor.position()
    }

    /// Does a step in this mode, with this supply voltage, change nothing?
    fn is_at_rest(&self, mode: MotorMode, supply_decivolts: u8) -> bool {
        self.motor.is_at_rest(mode) && self.reported == Some(self.report(supply_decivolts))
    }

    /// After the step that ended at `now`: until when steps with this supply voltage change nothing, if no call changes
    /// the servo. [`Servo::rest`] then replaces them.
    pub(crate) fn rest_until(&self, now: Instant, supply_decivolts: u8) -> Instant {
        if !self.is_at_rest(self.motor_mode(now), supply_decivolts) {
            return now;
        }
        let start = if self.ready_at > now { self.ready_at } else { Instant::FAR_FUTURE };
        let event = start.min(self.restarts_at).as_micros().saturating_sub(1);
        let heating = now.as_micros() + u64::from(self.temperature.steps_to_update()) * STEP.as_micros();
        Instant::from_micros(event.min(heating))
    }

    /// Simulates steps that change nothing.
    pub(crate) fn rest(&mut self, steps: u32) {
        self.temperature.steps(self.load(), steps);
        self.overload_steps = 0;
    }

    /// The mode of the motor in the step that ends at `now`.
    fn motor_mode(&self, now: Instant) -> MotorMode {
        let is_stuck = self.fault == Some(ServoFault::Stuck);
        if self.has_torque() {
            return if is_stuck { MotorMode::Blocked } else { MotorMode::Driven };
        }
        if is_stuck || self.is_held || self.is_supported {
            MotorMode::Held
        } else if self.torque(now) == Some(Torque::Damping) {
            MotorMode::Released(Drag::Damped)
        } else {
            MotorMode::Released(Drag::Free)
        }
    }

    fn check_overload(&mut self) {
        self.overload_steps = if self.load() > OVERLOAD { self.overload_steps + 1 } else { 0 };
        self.is_overloaded |= self.overload_steps >= OVERLOAD_STEPS;
    }

    fn report(&self, decivolts: u8) -> Reported {
        Reported { decivolts, celsius: self.temperature.celsius(), is_overloaded: self.is_overloaded }
    }

    fn update_registers(&mut self, voltage_decivolts: u8) {
        self.reported = Some(self.report(voltage_decivolts));
        self.registers.set_reading(&Reading {
            position_counts: self.motor.position_counts(),
            speed: self.motor.speed(),
            load: self.motor.load(),
            voltage_decivolts,
            temperature_celsius: self.temperature.celsius(),
        });
        self.registers.set_moving(self.motor.is_moving());
        self.registers.set_errors(if self.is_overloaded { error::OVERLOAD } else { 0 });
    }

    /// The load in either direction, in 0.1 %.
    #[must_use]
    pub fn load(&self) -> u16 {
        self.motor.load().unsigned_abs()
    }

    /// The position in counts, 0 to 1023.
    #[must_use]
    pub fn position_counts(&self) -> u16 {
        self.motor.position_counts()
    }

    /// Does it drive its joint?
    #[must_use]
    pub const fn has_torque(&self) -> bool {
        self.is_on && !self.is_overloaded
    }

    /// The position in millionths of a count.
    pub(crate) const fn position(&self) -> i64 {
        self.motor.position()
    }

    /// Sets the torque of the arm's weight, in micronewton metres, towards more counts.
    pub(crate) const fn set_weight(&mut self, weight: i64) {
        self.motor.set_weight(weight);
    }

    /// Turns it by hand, and holds it there. A servo with torque turns back.
    pub fn move_by_hand(&mut self, counts: u16) {
        self.motor.turn_to(counts);
        self.hold_by_hand(true);
    }

    /// Sets whether a hand holds it until it has torque.
    pub const fn hold_by_hand(&mut self, is_held: bool) {
        self.is_held = is_held && !self.is_on;
    }

    /// Sets whether a stand holds it whenever it has no torque.
    pub const fn support(&mut self, is_supported: bool) {
        self.is_supported = is_supported;
    }
}

/// When a servo with this fault restarts.
fn next_restart(now: Instant, fault: Option<ServoFault>) -> Instant {
    match fault {
        Some(ServoFault::Restarting(every)) => now + every,
        _ => Instant::FAR_FUTURE,
    }
}
