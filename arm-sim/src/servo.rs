//! One simulated servo: its end of the bus, its motor, its temper and its faults.
//!
//! Speaks frames; time comes in steps. Knows nothing of the wire's timing or of the other servos. Voltage,
//! temperature and load behave plausibly and prove nothing: no arm was measured.

mod fault;
mod gear;
mod motor;
pub(crate) mod units;
mod warmth;

use motion_core::servo_bus::frame::{BROADCAST, Frame, FrameBuffer, Instruction, error, register};
use motion_core::servo_bus::servo as protocol;
use motion_core::servo_bus::{Reading, Torque, TorqueCodes};
use protocol_core::registers::Joint;
use protocol_core::time::{Duration, Instant};

pub use fault::{Fault, UnknownFault};
use gear::Drag;
use motor::{Hold, Motor};
use warmth::Warmth;

/// Pushing harder than this, in 0.1 %, ..
const OVERLOAD: u16 = 800;
/// .. for so many steps makes a servo give up until its torque is switched off and on.
const OVERLOAD_STEPS: u32 = 1_000;

/// An answer on its way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    /// How much later than usual it comes.
    pub(crate) delay: Duration,
    pub(crate) bytes: FrameBuffer,
}

/// What a servo does by its make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Make {
    /// How long it hears nothing after a start.
    pub(crate) boot_time: Duration,
    /// What the codes of the torque switch mean.
    pub(crate) codes: TorqueCodes,
    /// After a start of its own, does a goal switch torque on?
    pub(crate) goal_starts_torque: bool,
}

/// A servo.
#[derive(Clone, Debug)]
pub(crate) struct Servo {
    make: Make,
    registers: protocol::Servo,
    motor: Motor,
    fault: Option<Fault>,
    /// It hears nothing before this time.
    ready_at: Instant,
    /// When it starts again by itself.
    restarts_at: Instant,
    /// Its torque switch was not written since it started.
    is_fresh: bool,
    is_on: bool,
    /// A hand keeps it from turning until it has torque.
    is_held: bool,
    /// A hand keeps it from turning whenever it has no torque.
    is_supported: bool,
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
    /// The servo of a joint, switched off until `ready_at`, in somebody's hand.
    pub(crate) fn new(joint: Joint, make: Make, position_counts: u16, ready_at: Instant) -> Self {
        Self {
            make,
            registers: protocol::Servo::new(joint.index()),
            motor: Motor::new(joint, position_counts),
            fault: None,
            ready_at,
            restarts_at: Instant::FAR_FUTURE,
            is_fresh: true,
            is_on: false,
            is_held: true,
            is_supported: false,
            is_overloaded: false,
            strained_steps: 0,
            answers: 0,
            warmth: Warmth::default(),
            shown: None,
        }
    }

    /// Power off and on: everything is forgotten but the place, the temperature, the defect, the servo's EEPROM
    /// and the hand.
    pub(crate) fn power_cycle(&mut self, ready_at: Instant) {
        self.registers.power_cycle();
        self.ready_at = ready_at;
        self.is_fresh = true;
        self.is_on = false;
        self.is_overloaded = false;
        self.strained_steps = 0;
        self.answers = 0;
        self.shown = None;
    }

    /// Makes it the servo with another id; all its registers are as they leave the factory.
    pub(crate) fn set_id(&mut self, id: u8) {
        self.registers = protocol::Servo::new(id);
    }

    /// Makes it defective, or well again. `ready_at` counts where that plugs the servo out or in.
    pub(crate) fn set_fault(&mut self, now: Instant, fault: Option<Fault>, ready_at: Instant) {
        let was_missing = self.fault == Some(Fault::Missing);
        self.fault = fault;
        self.restarts_at = next_restart(now, fault);
        if was_missing != (fault == Some(Fault::Missing)) {
            self.power_cycle(ready_at);
        }
    }

    /// Makes it one of another make.
    pub(crate) const fn set_make(&mut self, make: Make) {
        self.make = make;
    }

    /// Hears a frame at `now`.
    pub(crate) fn hear(&mut self, now: Instant, frame: &Frame<'_>) -> Option<Answer> {
        if now < self.ready_at || self.fault == Some(Fault::Missing) {
            return None;
        }
        self.is_fresh &= !writes_torque_switch(frame, self.registers.id());
        let answer = self.registers.handle_frame(frame);
        self.follow_registers();
        answer.map(|bytes| self.spoil(bytes))
    }

    fn follow_registers(&mut self) {
        let goal = self.registers.take_new_goal();
        if goal.is_some() && self.is_fresh && self.make.goal_starts_torque {
            let code = self.make.codes.code(Torque::On);
            let switch_on = [register::TORQUE_SWITCH, code];
            self.registers.handle_frame(&Frame {
                id: self.registers.id(),
                code: Instruction::Write as u8,
                params: &switch_on,
            });
        }
        self.follow_switch();
        if let Some(goal) = goal {
            self.motor.start(goal);
        }
    }

    fn follow_switch(&mut self) {
        let is_on = self.torque() == Torque::On;
        if is_on && !self.is_on {
            self.is_held = false;
            self.motor.rest();
            self.motor.start(self.registers.goal());
        }
        if !is_on {
            self.is_overloaded = false;
            self.strained_steps = 0;
        }
        self.is_on = is_on;
    }

    /// What its torque switch says.
    fn torque(&self) -> Torque {
        let code = self.registers.torque_switch();
        let says = |torque: &Torque| self.make.codes.code(*torque) == code;
        [Torque::On, Torque::Damping].into_iter().find(says).unwrap_or(Torque::Free)
    }

    /// What it does with its motor as of `now`; `None` where it does nothing: it has no power, or gave up after an
    /// overload.
    pub(crate) fn torque_at(&self, now: Instant) -> Option<Torque> {
        let has_power = now >= self.ready_at && self.fault != Some(Fault::Missing);
        (has_power && !self.is_overloaded).then(|| self.torque())
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

    /// Lets a step of the motor pass that ends at `now`, at this supply. Says whether it turned.
    pub(crate) fn step(&mut self, now: Instant, supply_decivolts: u8) -> bool {
        if now >= self.restarts_at {
            self.power_cycle(now + self.make.boot_time);
            self.restarts_at = next_restart(now, self.fault);
        }
        self.warmth.step(self.load());
        let hold = self.hold(now);
        if self.motor.is_at_rest(hold) && self.shown == Some(self.to_be_shown(supply_decivolts)) {
            // Nothing would change. Most steps of an arm are of this kind.
            self.strained_steps = 0;
            return false;
        }
        let before = self.motor.position();
        self.motor.step(hold);
        self.strain();
        self.show(supply_decivolts);
        before != self.motor.position()
    }

    /// What holds the motor in the step that ends at `now`.
    fn hold(&self, now: Instant) -> Hold {
        let is_stuck = self.fault == Some(Fault::Stuck);
        if self.has_torque() {
            return if is_stuck { Hold::Blocked } else { Hold::Driven };
        }
        if is_stuck || self.is_held || self.is_supported {
            Hold::Outside
        } else if self.torque_at(now) == Some(Torque::Damping) {
            Hold::Released(Drag::Damped)
        } else {
            Hold::Released(Drag::Free)
        }
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

    /// Does it drive its joint?
    pub(crate) const fn has_torque(&self) -> bool {
        self.is_on && !self.is_overloaded
    }

    /// Where it is, in millionths of a count.
    pub(crate) const fn position(&self) -> i64 {
        self.motor.position()
    }

    /// Loads it with a torque in micronewton metres, towards more counts.
    pub(crate) const fn load_with(&mut self, weight: i64) {
        self.motor.load_with(weight);
    }

    /// Turns it from outside, and holds it there. A servo with torque goes back.
    pub(crate) fn move_by_hand(&mut self, counts: u16) {
        self.motor.turn_to(counts);
        self.hold_by_hand(true);
    }

    /// Keeps it from turning until it has torque, or no longer.
    pub(crate) const fn hold_by_hand(&mut self, is_held: bool) {
        self.is_held = is_held && !self.is_on;
    }

    /// Keeps it from turning whenever it has no torque, or no longer.
    pub(crate) const fn support(&mut self, is_supported: bool) {
        self.is_supported = is_supported;
    }
}

/// When a servo with this fault starts again by itself.
fn next_restart(now: Instant, fault: Option<Fault>) -> Instant {
    match fault {
        Some(Fault::Restarting(every)) => now + every,
        _ => Instant::FAR_FUTURE,
    }
}

/// Is this a frame that writes the torque switch of the servo with this id?
fn writes_torque_switch(frame: &Frame<'_>, id: u8) -> bool {
    match (Instruction::from_code(frame.code), frame.params) {
        (Some(Instruction::Write), [register::TORQUE_SWITCH, _, ..]) => {
            frame.id == id || frame.id == BROADCAST
        }
        (Some(Instruction::SyncWrite), [register::TORQUE_SWITCH, width, items @ ..]) => {
            let mut items = items.chunks_exact(usize::from(*width) + 1);
            items.any(|item| item.first() == Some(&id))
        }
        _ => false,
    }
}
