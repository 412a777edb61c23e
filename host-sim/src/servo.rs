//! One simulated servo: its end of the bus, its motor, its temper and its faults.
//!
//! Speaks frames; time comes in steps. Knows nothing of the wire's timing or of the other servos. Voltage,
//! temperature and load behave plausibly and prove nothing: no arm was measured.

mod fault;
pub(crate) mod motor;

use motion_core::servo_bus::frame::{Frame, FrameBuffer, error};
use motion_core::servo_bus::servo as protocol;
use motion_core::servo_bus::{Reading, Torque, TorqueCodes};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

pub use fault::{Fault, UnknownFault};
use motor::{Hold, Motor};

/// Pushing harder than this, in 0.1 %, ..
const OVERLOAD: u16 = 800;
/// .. for so many steps makes a servo give up until its torque is switched off and on.
const OVERLOAD_STEPS: u32 = 1_000;
/// The temperature around the arm, in thousandths of a degree Celsius.
const AMBIENT: u32 = 25_000;
/// How much warmer a servo gets in the long run for each 0.1 % it pushes, in thousandths of a degree.
const WARMTH_PER_LOAD: u32 = 40;
/// The steps between two looks at the temperature: a second.
const WARMING_STEPS: u32 = 1_000;
/// The time constant of the temperature, in such looks.
const WARMING_LAG: u32 = 300;

/// An answer on its way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    /// How much later than usual it comes.
    pub(crate) delay: Duration,
    pub(crate) bytes: FrameBuffer,
}

/// A servo.
#[derive(Clone, Debug)]
pub(crate) struct Servo {
    joint: Joint,
    codes: TorqueCodes,
    registers: protocol::Servo,
    motor: Motor,
    fault: Option<Fault>,
    /// It hears nothing before this time.
    ready_at: Instant,
    is_on: bool,
    is_overloaded: bool,
    /// For how many steps it has been pushing too hard.
    strained_steps: u32,
    /// How many answers it gave.
    answers: u32,
    warmth: Warmth,
    /// What the registers were last told, less what the motor says.
    shown: Option<Shown>,
}

/// What a servo says of itself, less what its motor does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shown {
    decivolts: u8,
    celsius: u8,
    is_overloaded: bool,
}

impl Servo {
    /// The servo of a joint, switched off until `ready_at`, then free of torque.
    pub(crate) fn new(joint: Joint, codes: TorqueCodes, position_counts: u16, ready_at: Instant) -> Self {
        Self {
            joint,
            codes,
            registers: protocol::Servo::new(joint.index()),
            motor: Motor::new(joint, position_counts),
            fault: None,
            ready_at,
            is_on: false,
            is_overloaded: false,
            strained_steps: 0,
            answers: 0,
            warmth: Warmth::default(),
            shown: None,
        }
    }

    /// Power off and on: everything is forgotten but the place, the temperature and the defect.
    pub(crate) fn power_cycle(&mut self, ready_at: Instant) {
        let fresh = Self::new(self.joint, self.codes, self.motor.position_counts(), ready_at);
        *self = Self { fault: self.fault, warmth: self.warmth, ..fresh };
    }

    /// Makes it defective, or well again. `ready_at` counts where that plugs the servo out or in.
    pub(crate) fn set_fault(&mut self, fault: Option<Fault>, ready_at: Instant) {
        let was_missing = self.fault == Some(Fault::Missing);
        self.fault = fault;
        if was_missing != (fault == Some(Fault::Missing)) {
            self.power_cycle(ready_at);
        }
    }

    /// Hears a frame at `now`.
    pub(crate) fn hear(&mut self, now: Instant, frame: &Frame<'_>) -> Option<Answer> {
        if now < self.ready_at || self.fault == Some(Fault::Missing) {
            return None;
        }
        let answer = self.registers.hear(frame);
        self.follow_switch();
        answer.map(|bytes| self.spoil(bytes))
    }

    fn follow_switch(&mut self) {
        let is_on = self.registers.torque_switch() == self.codes.code(Torque::On);
        if is_on && !self.is_on {
            self.motor.rest();
            self.motor.start(self.registers.goal());
        }
        if !is_on {
            self.is_overloaded = false;
            self.strained_steps = 0;
        }
        self.is_on = is_on;
        if let Some(goal) = self.registers.take_new_goal() {
            self.motor.start(goal);
        }
    }

    fn spoil(&mut self, mut bytes: FrameBuffer) -> Answer {
        self.answers = self.answers.wrapping_add(1);
        let mut delay = Duration::ZERO;
        match self.fault {
            Some(Fault::Late(by)) => delay = by,
            Some(Fault::Garbled(every)) if self.answers.is_multiple_of(every) => {
                bytes.last_mut().into_iter().for_each(|checksum| *checksum ^= 0x55);
            }
            _ => {}
        }
        Answer { delay, bytes }
    }

    /// Lets a step of the motor pass, at this supply.
    pub(crate) fn step(&mut self, supply_decivolts: u8) {
        self.warmth.step(self.load());
        if self.motor.is_at_rest() && self.shown == Some(self.to_be_shown(supply_decivolts)) {
            // Nothing would change. Most steps of an arm are of this kind.
            self.strained_steps = 0;
            return;
        }
        let hold = match (self.is_on && !self.is_overloaded, self.fault) {
            (false, _) => Hold::Released,
            (true, Some(Fault::Stuck)) => Hold::Blocked,
            (true, _) => Hold::Driven,
        };
        self.motor.step(hold);
        self.strain();
        self.show(supply_decivolts);
    }

    fn to_be_shown(&self, decivolts: u8) -> Shown {
        Shown { decivolts, celsius: self.warmth.celsius(), is_overloaded: self.is_overloaded }
    }

    fn strain(&mut self) {
        self.strained_steps = if self.load() > OVERLOAD { self.strained_steps + 1 } else { 0 };
        self.is_overloaded |= self.strained_steps >= OVERLOAD_STEPS;
    }

    fn show(&mut self, voltage_decivolts: u8) {
        self.shown = Some(self.to_be_shown(voltage_decivolts));
        self.registers.set_reading(&Reading {
            position_counts: self.motor.position_counts(),
            speed: self.motor.speed(),
            load: self.motor.load(),
            voltage_decivolts,
            temperature_celsius: self.warmth.celsius(),
        });
        self.registers.set_moving(self.motor.is_moving());
        self.registers.set_errors(if self.is_overloaded { error::OVERLOAD } else { 0 });
    }

    /// How hard it pushes either way, in 0.1 %.
    pub(crate) fn load(&self) -> u16 {
        self.motor.load().unsigned_abs()
    }

    /// Where it is, 0 to 1023.
    pub(crate) fn position_counts(&self) -> u16 {
        self.motor.position_counts()
    }

    /// Turns it from outside. A servo with torque goes back.
    pub(crate) fn move_by_hand(&mut self, counts: u16) {
        self.motor.turn_to(counts);
    }
}

/// How warm a servo is.
#[derive(Clone, Copy, Debug)]
struct Warmth {
    /// In thousandths of a degree Celsius.
    millidegrees: u32,
    /// The loads of the steps since the last look.
    loads: u32,
    steps: u32,
}

impl Default for Warmth {
    fn default() -> Self {
        Self { millidegrees: AMBIENT, loads: 0, steps: 0 }
    }
}

impl Warmth {
    fn step(&mut self, load: u16) {
        self.loads += u32::from(load);
        self.steps += 1;
        if self.steps < WARMING_STEPS {
            return;
        }
        let aim = AMBIENT + WARMTH_PER_LOAD * self.loads / WARMING_STEPS;
        let millidegrees = (self.millidegrees * (WARMING_LAG - 1) + aim) / WARMING_LAG;
        *self = Self { millidegrees, loads: 0, steps: 0 };
    }

    fn celsius(self) -> u8 {
        u8::try_from(self.millidegrees / 1_000).unwrap_or(u8::MAX)
    }
}
