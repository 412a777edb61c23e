//! The motor and position control of one simulated servo, a millisecond at a time.
//!
//! ```text
//!   goal ──▶ set-point, at the speed or in the time asked for ──▶ position, lagging behind
//!                                              weight of the arm ──▶ and drooping
//! ```
//!
//! With torque, control is proportional: a load turns the joint away from its set-point, by a count at the
//! stall torque. Without torque, the weight turns it as [`gear`](super::gear) says, to the servo's mechanical
//! ends at 0 and 1023 counts.
//!
//! Integers in fixed steps: a run comes out the same however often anybody looks. The speed limit is the
//! motor's (62 rpm); lag and droop are assumed, as no arm was measured. Knows nothing of frames.

use motion_core::calibration::angle_from_counts;
use motion_core::servo_bus::Reading;
use motion_core::servo_bus::servo::Goal;
use protocol_core::registers::Joint;

use super::gear::{Drag, Gear};
use super::units::{COUNT, COUNT_PER_SECOND};

/// The other mechanical end of the servo; the first is 0.
const END: i64 = Reading::MAX_POSITION as i64 * COUNT;
/// 62 revolutions a minute, in micro-degrees per second.
const MAX_SPEED: i64 = 372_000_000;
/// The position makes up for a part of what it lags behind in each step: a time constant of 20 ms.
const LAG_STEPS: i64 = 20;
/// Closer than this (1/16 count), and the position is the set-point.
const SNAP: i64 = COUNT / 16;
/// How hard the motor pushes for each count it lags behind, in 0.1 %.
const LOAD_PER_COUNT: i64 = 10;
/// How far a load turns the joint away from its set-point, in millionths of a count for each millionth of the
/// stall torque: a count (0.21 degrees of joints 1 to 4) at that torque.
const DROOP: i64 = 1;

/// One motor with its gear and its position sensor.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    gear: Gear,
    /// The most it turns in a step.
    fastest: i64,
    position: i64,
    /// The torque of the arm's weight, in micronewton metres, towards more counts.
    weight: i64,
    /// What held it in the last step.
    hold: Hold,
    /// Where its control wants it to be now.
    set_point: i64,
    target: i64,
    /// How far the set-point goes in a step.
    rate: i64,
    /// How far the position went in the last step.
    moved: i64,
}

/// What holds a motor in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    /// Something from outside: it stays where it is.
    Outside,
    /// Its friction, and what resists besides.
    Released(Drag),
    /// It is driven and turns.
    Driven,
    /// It is driven, but something keeps it from turning.
    Blocked,
}

impl Motor {
    /// The motor of a joint's servo, at rest.
    pub(crate) fn new(joint: Joint, position_counts: u16) -> Self {
        let position = i64::from(position_counts) * COUNT;
        Self {
            gear: Gear::of(joint),
            fastest: fastest(joint),
            position,
            weight: 0,
            hold: Hold::Outside,
            set_point: position,
            target: position,
            rate: 0,
            moved: 0,
        }
    }

    /// Begins a move from where the set-point is.
    pub(crate) fn start(&mut self, goal: Goal) {
        self.target = i64::from(goal.position_counts) * COUNT;
        let distance = (self.target - self.set_point).abs();
        let rate = match (i64::from(goal.speed), i64::from(goal.time_ms)) {
            (0, 0) => self.fastest,
            // Rounded up, or the last step would come late.
            (0, millis) => (distance + millis - 1) / millis,
            (speed, _) => speed * COUNT_PER_SECOND,
        };
        self.rate = rate.min(self.fastest);
    }

    /// Forgets the move: the set-point is where the motor is.
    pub(crate) fn rest(&mut self) {
        self.set_point = self.position;
        self.target = self.position;
    }

    /// Lets a [`STEP`](super::units::STEP) pass.
    pub(crate) fn step(&mut self, hold: Hold) {
        self.hold = hold;
        if let Hold::Outside | Hold::Released(_) = hold {
            self.rest();
        }
        self.set_point += (self.target - self.set_point).clamp(-self.rate, self.rate);
        let way = match hold {
            Hold::Outside | Hold::Blocked => 0,
            Hold::Driven => self.pull(),
            Hold::Released(drag) => self.gear.speed_after(self.moved, self.weight, drag),
        };
        let before = self.position;
        self.position = (before + way).clamp(0, END);
        self.moved = self.position - before;
        if let Hold::Released(_) = hold {
            self.rest();
        }
    }

    fn pull(&self) -> i64 {
        let behind = self.balance() - self.position;
        if behind.abs() <= SNAP { behind } else { (behind / LAG_STEPS).clamp(-self.fastest, self.fastest) }
    }

    /// Where control and weight are in balance.
    fn balance(&self) -> i64 {
        (self.set_point + DROOP * self.gear.share_of_stall(self.weight)).clamp(0, END)
    }

    /// Loads it with a torque in micronewton metres, towards more counts.
    pub(crate) const fn load_with(&mut self, weight: i64) {
        self.weight = weight;
    }

    /// Turns it from outside.
    pub(crate) fn turn_to(&mut self, position_counts: u16) {
        self.position = i64::from(position_counts.min(Reading::MAX_POSITION)) * COUNT;
        self.moved = 0;
    }

    /// Where it is, in millionths of a count.
    pub(crate) const fn position(&self) -> i64 {
        self.position
    }

    /// Where it is, 0 to 1023.
    pub(crate) fn position_counts(&self) -> u16 {
        let counts = (self.position + COUNT / 2) / COUNT;
        u16::try_from(counts).unwrap_or(0).min(Reading::MAX_POSITION)
    }

    /// How fast it turns, in counts per second.
    pub(crate) fn speed(&self) -> i16 {
        i16::try_from(self.moved / COUNT_PER_SECOND).unwrap_or(0)
    }

    /// How hard it pushes, in 0.1 %: plus is towards more counts.
    pub(crate) fn load(&self) -> i16 {
        let load = match self.hold {
            Hold::Outside | Hold::Released(_) => 0,
            Hold::Blocked => self.push(self.set_point),
            Hold::Driven => self.push(self.balance()) - self.gear.share_of_stall(self.weight) / 1_000,
        };
        i16::try_from(load.clamp(-1_000, 1_000)).unwrap_or(0)
    }

    const fn push(&self, aim: i64) -> i64 {
        (aim - self.position) * LOAD_PER_COUNT / COUNT
    }

    /// Would a step change nothing, if it is held like this?
    pub(crate) fn is_at_rest(&self, hold: Hold) -> bool {
        let is_still = match hold {
            Hold::Outside | Hold::Blocked => self.position == self.set_point,
            Hold::Released(_) => {
                self.position == self.set_point && (self.gear.holds(self.weight) || self.is_at_end())
            }
            Hold::Driven => self.position == self.balance(),
        };
        is_still && hold == self.hold && self.moved == 0 && self.set_point == self.target
    }

    /// Does an end keep its weight from turning it further?
    const fn is_at_end(&self) -> bool {
        (self.position <= 0 && self.weight < 0) || (self.position >= END && self.weight > 0)
    }

    /// Has it somewhere to go?
    pub(crate) fn is_moving(&self) -> bool {
        self.moved != 0 || self.set_point != self.target
    }
}

/// The most a joint's servo turns in a step, from the degrees its counts have.
fn fastest(joint: Joint) -> i64 {
    /// So many counts of either kind of servo are a whole number of thousandths of a degree.
    const SPAN: u16 = 850;
    let angle = angle_from_counts(joint, SPAN, 0).0 - angle_from_counts(joint, 0, 0).0;
    MAX_SPEED * i64::from(SPAN) * COUNT_PER_SECOND / i64::from(angle).abs().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motor(joint: usize) -> Motor {
        Motor::new(Joint::ALL[joint - 1], 100)
    }

    /// Steps until the motor is at rest.
    fn duration_ms(motor: &mut Motor) -> u32 {
        for step in 0..100_000 {
            if !motor.is_moving() {
                return step;
            }
            motor.step(Hold::Driven);
        }
        panic!("it never arrives");
    }

    fn goal(position_counts: u16, time_ms: u16, speed: u16) -> Goal {
        Goal { position_counts, time_ms, speed }
    }

    /// How much longer than its set-point a motor may take: a few time constants.
    const SETTLING_MS: u32 = 160;

    fn assert_takes(motor: &mut Motor, millis: u32) {
        let took = duration_ms(motor);
        assert!((millis..millis + SETTLING_MS).contains(&took), "{took} ms instead of {millis}");
    }

    #[test]
    fn no_motor_turns_faster_than_62_rpm() {
        assert_eq!(
            [fastest(Joint::ALL[0]), fastest(Joint::ALL[1])],
            [1_756_666; 2],
            "850/180 counts a degree"
        );
        assert_eq!([fastest(Joint::ALL[4]), fastest(Joint::ALL[6])], [1_291_666; 2], "625/180");
        for (joint, counts_per_second) in [(1, 1_757), (7, 1_292)] {
            for goal in [goal(1_000, 0, 0), goal(1_000, 1, 0), goal(1_000, 0, 5_000)] {
                let mut motor = motor(joint);
                motor.start(goal);
                (0..200).for_each(|_| motor.step(Hold::Driven));
                assert!(i32::from(motor.speed()) <= counts_per_second);
                assert!(motor.load() < 400, "a set-point that runs away would overload it");
                assert_takes(&mut motor, 900_000 / counts_per_second.unsigned_abs() - 200);
                assert_eq!(motor.position_counts(), 1_000);
            }
        }
    }

    #[test]
    fn speed_is_in_counts_per_second_and_goes_before_time() {
        let mut motor = motor(1);
        motor.start(goal(700, 100, 300));
        assert_takes(&mut motor, 2_000);
        assert_eq!(motor.position_counts(), 700);
    }

    #[test]
    fn time_counts_where_speed_is_0() {
        let mut motor = motor(1);
        motor.start(goal(700, 3_000, 0));
        assert_takes(&mut motor, 3_000);
        assert_eq!(motor.position_counts(), 700);
        motor.start(goal(50, 1_000, 0));
        assert_takes(&mut motor, 1_000);
        assert_eq!(motor.position_counts(), 50);
    }

    #[test]
    fn a_new_speed_acts_on_the_way() {
        let mut motor = motor(1);
        motor.start(goal(700, 0, 300));
        (0..1_000).for_each(|_| motor.step(Hold::Driven));
        motor.start(goal(700, 0, 100));
        assert_takes(&mut motor, 3_000);
    }

    #[test]
    fn the_position_lags_behind_and_shows_speed_and_load() {
        let mut motor = motor(1);
        motor.start(goal(700, 0, 300));
        (0..500).for_each(|_| motor.step(Hold::Driven));
        assert_eq!(motor.position_counts(), 100 + 150 - 6, "300 counts/s times 20 ms");
        assert!((298..=300).contains(&motor.speed()), "{}", motor.speed());
        assert!((55..=60).contains(&motor.load()), "{}", motor.load());
        motor.start(goal(0, 0, 300));
        (0..500).for_each(|_| motor.step(Hold::Driven));
        assert!((-300..=-298).contains(&motor.speed()), "{}", motor.speed());
        assert!((-60..=-55).contains(&motor.load()), "{}", motor.load());
    }

    #[test]
    fn a_released_motor_stays_and_a_blocked_one_pushes() {
        let mut motor = motor(1);
        motor.start(goal(700, 0, 0));
        (0..500).for_each(|_| motor.step(Hold::Blocked));
        assert_eq!((motor.position_counts(), motor.speed(), motor.load()), (100, 0, 1_000));
        let released = Hold::Released(Drag::Free);
        (0..500).for_each(|_| motor.step(released));
        assert_eq!((motor.position_counts(), motor.load(), motor.is_moving()), (100, 0, false));
        motor.turn_to(u16::MAX);
        motor.step(released);
        assert_eq!((motor.position_counts(), motor.speed()), (1_023, 0));
    }

    #[test]
    fn a_driven_motor_droops_by_half_a_count_for_half_its_stall_torque_and_shows_the_load() {
        for (weight, load) in [(809_000, -500), (-809_000, 500)] {
            let mut motor = motor(3);
            motor.start(goal(500, 0, 0));
            motor.load_with(weight);
            (0..1_000).for_each(|_| motor.step(Hold::Driven));
            assert_eq!(motor.position(), 500 * COUNT + weight.signum() * COUNT / 2);
            assert_eq!((motor.load(), motor.speed()), (load, 0));
            assert!(motor.is_at_rest(Hold::Driven) && !motor.is_at_rest(Hold::Released(Drag::Free)));
        }
    }

    #[test]
    fn a_released_motor_turns_under_its_weight_to_its_end() {
        for (weight, end) in [(400_000, 1_023), (-400_000, 0)] {
            let mut motor = motor(3);
            motor.load_with(weight);
            motor.step(Hold::Released(Drag::Free));
            assert!(!motor.is_at_rest(Hold::Released(Drag::Free)));
            (0..10_000).for_each(|_| motor.step(Hold::Released(Drag::Free)));
            assert_eq!((motor.position_counts(), motor.speed(), motor.load()), (end, 0, 0));
            assert!(motor.is_at_rest(Hold::Released(Drag::Free)));
        }
    }

    #[test]
    fn torque_stops_a_fall() {
        let mut motor = motor(3);
        motor.turn_to(500);
        motor.load_with(-400_000);
        (0..200).for_each(|_| motor.step(Hold::Released(Drag::Free)));
        let caught_at = motor.position_counts();
        assert!((400..480).contains(&caught_at), "{caught_at}");
        (0..500).for_each(|_| motor.step(Hold::Driven));
        assert!(motor.position_counts().abs_diff(caught_at) <= 1, "{}", motor.position_counts());
    }
}
