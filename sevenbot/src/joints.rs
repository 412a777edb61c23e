//! The joints at one instant, and what follows from it: what a stop has to write, and where a step begins.
//!
//! ```text
//!   motor state, targets, positions, silent and moving joints ──▶ JointSnapshot ──▶ targets that hold the arm
//!                                                                              └──▶ the base of a relative step
//! ```
//!
//! A position of 0 is 0 degrees or, in the first half second after power-up, a joint that was not measured yet. No
//! register tells start-up from operation, but these facts do: a silent joint (242) is told only after start-up; a
//! joint at rest whose target is not the power-up value was measured; 700 ms after the first look start-up is over.

use std::fmt;
use std::thread::sleep;
use std::time::{Duration, Instant};

use protocol_core::registers::map::{MOTOR_STATE, PRESENT_POSITION, TARGET_POSITION, motor_state};
use protocol_core::registers::{Joint, Register};

use crate::arm::Arm;
use crate::change::{Cause, Unchanged, verdict};
use crate::error::Error;
use crate::snapshot::Snapshot;
use crate::span::Span;
use crate::status::Status;

/// After power-up an arm measures its joints, or calls them silent, within 500 ms (D12). The rest is for the answer.
const START_UP: Duration = Duration::from_millis(700);
/// Time between two looks at an arm that starts.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// How often targets are written before their loss counts as a failure.
const HOLD_ATTEMPTS: u32 = 5;
/// A joint this near to its target stands there: a loaded servo stops a few degrees short.
const STANDS_WITHIN_DEGREES: u8 = 5;

/// Why it is not known that the arm holds.
///
/// ```
/// use sevenbot::joints::NotHeld;
///
/// let reason = NotHeld::NotTaken(Vec::new());
/// assert!(reason.to_string().contains("did not take"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotHeld {
    /// The arm could not be asked.
    Wire(Error),
    /// The targets do not hold what was written, however often it was.
    NotTaken(Vec<Unchanged>),
}

impl From<Error> for NotHeld {
    fn from(error: Error) -> Self {
        Self::Wire(error)
    }
}

impl fmt::Display for NotHeld {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wire(error) => error.fmt(out),
            Self::NotTaken(unchanged) => {
                out.write_str("the arm did not take the targets that hold it")?;
                unchanged.first().map_or(Ok(()), |first| write!(out, ": {first}"))
            }
        }
    }
}

impl std::error::Error for NotHeld {}

/// Why a relative step of a joint has no known start.
///
/// ```
/// assert_eq!(sevenbot::joints::NoBase::Silent.to_string(), "its servo does not answer");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoBase {
    /// Its servo does not answer.
    Silent,
    /// Its target is still the value of power-up, and it stands elsewhere.
    PowerUpTarget {
        /// In degrees.
        target: u8,
        /// In degrees.
        present: u8,
    },
}

impl fmt::Display for NoBase {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent => out.write_str("its servo does not answer"),
            Self::PowerUpTarget { target, present } => write!(
                out,
                "it stands at {present}°, and its target of {target}° may be the value of power-up"
            ),
        }
    }
}

/// A target that a stop has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sent {
    degrees: u8,
    /// It was 0, and may not have been measured.
    was_doubtful: bool,
}

const NOTHING_SENT: [Option<Sent>; 7] = [None; 7];

impl Arm {
    /// The joints at this instant.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn joints(&mut self) -> Result<JointSnapshot, Error> {
        let status = self.status()?;
        let registers = self.read_span(Span::between(&MOTOR_STATE, &PRESENT_POSITION))?;
        Ok(JointSnapshot { registers, status })
    }

    /// Makes every joint hold where it is, and makes sure that it took: the targets are written, read back, and written
    /// again where they differ. Returns the joints as they were read back.
    ///
    /// Where the motors do not drive the joints (state 0 or 2) there is nothing to write. A joint whose servo is silent
    /// gets the position that was measured last as its target, for the time when it answers again; one that was never
    /// measured is left alone. A joint that may not be measured yet, because the arm was just switched on, is waited
    /// for, up to 0.7 s; the others are held before.
    ///
    /// # Errors
    /// No answer, or the arm does not take the targets: it may be moving.
    pub fn hold(&mut self) -> Result<JointSnapshot, NotHeld> {
        self.patiently(Self::hold_until_seen)
    }

    fn hold_until_seen(&mut self) -> Result<JointSnapshot, NotHeld> {
        let start = Instant::now();
        let mut before = None;
        let mut sent = NOTHING_SENT;
        let mut losses = 0;
        loop {
            let joints = self.joints()?;
            if !joints.is_driven() {
                return Ok(joints);
            }
            let is_up = start.elapsed() >= START_UP;
            let before: &JointSnapshot = before.get_or_insert_with(|| joints.clone());
            let lost = joints.lost(&sent, before);
            losses += u32::from(!lost.is_empty());
            if losses >= HOLD_ATTEMPTS {
                return Err(NotHeld::NotTaken(lost));
            }
            let targets = joints.to_hold(&sent, is_up);
            for (address, degrees) in frames_for(&TARGET_POSITION, &targets) {
                self.write(address, &degrees)?;
            }
            for ((sent, target), joint) in sent.iter_mut().zip(targets).zip(Joint::ALL) {
                let was_doubtful = joints.is_doubtful(joint, is_up);
                *sent = target.map(|degrees| Sent { degrees, was_doubtful }).or(*sent);
            }
            if targets == [None; 7] {
                if !Joint::ALL.into_iter().any(|joint| joints.is_doubtful(joint, is_up)) {
                    return Ok(joints);
                }
                sleep(LOOK_EVERY);
            }
        }
    }

    /// Waits until each joint has a target of its own rather than that of power-up, which after the arm's start takes
    /// up to half a second (D12); no longer than 0.7 s. Returns the joints as they are then.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn wait_until_settled(&mut self) -> Result<JointSnapshot, Error> {
        let deadline = Instant::now() + START_UP;
        loop {
            let joints = self.joints()?;
            let is_settled = !Joint::ALL.into_iter().any(|joint| joints.has_power_up_target(joint));
            if is_settled || Instant::now() >= deadline {
                return Ok(joints);
            }
            sleep(LOOK_EVERY);
        }
    }
}

/// All joints of an arm, of one instant but for the time between two reads.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
/// println!("{:?}", arm.hold()?.positions());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct JointSnapshot {
    /// From the motor state to the present positions.
    registers: Snapshot,
    /// `None` from firmware without a status block.
    status: Option<Status>,
}

impl JointSnapshot {
    /// Register 29.
    #[must_use]
    pub fn motor_state(&self) -> u8 {
        self.registers.byte(&MOTOR_STATE)
    }

    /// Do the motors drive the joints?
    #[must_use]
    pub fn is_driven(&self) -> bool {
        self.motor_state() == motor_state::SERVO
    }

    /// Where the joint should be, in degrees.
    #[must_use]
    pub fn target(&self, joint: Joint) -> u8 {
        self.registers.at(TARGET_POSITION.of(joint))
    }

    /// Where the joint is, in degrees; 0 as well where that was never measured.
    #[must_use]
    pub fn present(&self, joint: Joint) -> u8 {
        self.registers.at(PRESENT_POSITION.of(joint))
    }

    /// Where the joints should be, joint 1 first, in degrees.
    #[must_use]
    pub fn targets(&self) -> [u8; 7] {
        self.registers.joints(&TARGET_POSITION)
    }

    /// Where the joints are, joint 1 first, in degrees.
    #[must_use]
    pub fn positions(&self) -> [u8; 7] {
        self.registers.joints(&PRESENT_POSITION)
    }

    /// The joints whose servo does not answer, by their [`Joint::bit`]s.
    #[must_use]
    pub fn missing(&self) -> u8 {
        self.status.as_ref().map_or(0, Status::missing)
    }

    fn is_missing(&self, joint: Joint) -> bool {
        self.missing() & joint.bit() != 0
    }

    fn is_moving(&self, joint: Joint) -> bool {
        self.status.as_ref().is_some_and(|status| status.is_moving(joint))
    }

    /// Where a relative step of this joint begins: its target, in degrees.
    ///
    /// # Errors
    /// It is not known where the joint is, or whether the target was ever its own.
    pub fn step_base(&self, joint: Joint) -> Result<u8, NoBase> {
        let (target, present) = (self.target(joint), self.present(joint));
        match () {
            () if self.is_missing(joint) => Err(NoBase::Silent),
            () if self.has_power_up_target(joint) => Err(NoBase::PowerUpTarget { target, present }),
            () => Ok(target),
        }
    }

    /// May the target be the one of power-up, with the joint elsewhere?
    fn has_power_up_target(&self, joint: Joint) -> bool {
        let (target, present) = (self.target(joint), self.present(joint));
        // The maker's firmware may start with other targets; 0 is the likeliest.
        let is_default = target == TARGET_POSITION.default_at(TARGET_POSITION.of(joint))
            || (self.status.is_none() && target == 0);
        is_default
            && self.is_driven()
            && !self.is_missing(joint)
            && !self.is_moving(joint)
            && target.abs_diff(present) > STANDS_WITHIN_DEGREES
    }

    /// May the position of 0 mean that the joint is not measured yet? `is_up`: the arm has been up for long enough.
    fn is_doubtful(&self, joint: Joint, is_up: bool) -> bool {
        let is_start_up_over = is_up || self.missing() != 0;
        // Power-up targets are not 0, and a target that the host wrote in start-up counts as on its way.
        let was_measured = self.target(joint) == 0 && !self.is_moving(joint);
        self.present(joint) == 0 && !is_start_up_over && !was_measured
    }

    /// The targets to write now, so that the joints hold where they are, after `sent` was written.
    fn to_hold(&self, sent: &[Option<Sent>; 7], is_up: bool) -> [Option<u8>; 7] {
        let mut targets = [None; 7];
        for ((target, sent), joint) in targets.iter_mut().zip(sent).zip(Joint::ALL) {
            let is_done = sent.is_some_and(|sent| {
                let is_measured_now = sent.was_doubtful && self.present(joint) != 0;
                self.target(joint) == sent.degrees && !is_measured_now
            });
            *target = self.place_to_hold(joint, is_up).filter(|_| !is_done);
        }
        targets
    }

    /// Where the joint is to be held; `None` while that is not known.
    fn place_to_hold(&self, joint: Joint, is_up: bool) -> Option<u8> {
        let present = self.present(joint);
        let is_unknown = present == 0 && self.is_missing(joint);
        // A doubtful joint on its way has left 0 degrees just now, or another host sent it somewhere during start-up.
        // It cannot wait, and in start-up it is not driven before it was measured, which the next look shows.
        let may_wait = self.is_doubtful(joint, is_up) && !self.is_moving(joint);
        (!is_unknown && !may_wait).then_some(present)
    }

    /// The targets that do not hold what was sent.
    fn lost(&self, sent: &[Option<Sent>; 7], before: &Self) -> Vec<Unchanged> {
        let cause = match (&before.status, &self.status) {
            (Some(before), Some(after)) => verdict(before, after),
            _ => Cause::Unknown,
        };
        let pairs = Joint::ALL.into_iter().zip(sent).filter_map(|(joint, sent)| Some((joint, (*sent)?)));
        pairs
            .map(|(joint, sent)| (joint, sent.degrees, self.target(joint)))
            .filter(|(_, wanted, found)| wanted != found)
            .map(|(joint, wanted, found)| Unchanged {
                address: TARGET_POSITION.of(joint),
                wanted,
                found,
                cause,
            })
            .collect()
    }
}

/// The writes that give new values to some of a row's joints, joint 1 first, and leave the others alone: one
/// frame for each run of neighbours.
#[must_use]
pub fn frames_for(row: &Register, values: &[Option<u8>; 7]) -> Vec<(u8, Vec<u8>)> {
    let pairs: Vec<_> = Joint::ALL.into_iter().zip(values).collect();
    let runs = pairs.chunk_by(|one, next| one.1.is_some() == next.1.is_some());
    let frame = |run: &[(Joint, &Option<u8>)]| {
        let values: Vec<u8> = run.iter().filter_map(|(_, value)| **value).collect();
        let (first, _) = run.first()?;
        (!values.is_empty()).then(|| (row.of(*first), values))
    };
    runs.filter_map(frame).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::{MISSING_SERVOS, MOVING_JOINTS};

    const UP: [u8; 7] = [120, 90, 65, 90, 90, 90, 80];

    fn look(targets: [u8; 7], positions: [u8; 7], missing: u8, moving: u8) -> JointSnapshot {
        let mut registers = Snapshot { address: MOTOR_STATE.address, values: vec![0; 32] };
        registers.values[0] = motor_state::SERVO;
        registers.values[17..24].copy_from_slice(&targets);
        registers.values[25..32].copy_from_slice(&positions);
        let mut status = Snapshot { address: 240, values: vec![0; 16] };
        status.values[usize::from(MISSING_SERVOS.address - 240)] = missing;
        status.values[usize::from(MOVING_JOINTS.address - 240)] = moving;
        JointSnapshot { registers, status: Some(Status::from(status)) }
    }

    fn power_up(positions: [u8; 7], missing: u8, moving: u8) -> JointSnapshot {
        look(TARGET_POSITION.defaults, positions, missing, moving)
    }

    #[test]
    fn every_measured_joint_is_held_where_it_is() {
        let joints = look([170, 90, 65, 90, 90, 90, 80], UP, 0, 1);
        assert_eq!(joints.to_hold(&NOTHING_SENT, false), UP.map(Some));
        assert!(!joints.is_doubtful(Joint::ALL[0], false));
    }

    #[test]
    fn what_was_written_is_written_again_only_where_it_did_not_take() {
        let sent = UP.map(|degrees| Some(Sent { degrees, was_doubtful: false }));
        assert_eq!(look(UP, UP, 0, 0).to_hold(&sent, false), [None; 7]);
        let lost = look([170, 90, 65, 90, 90, 90, 80], [125, 90, 65, 90, 90, 90, 80], 0, 1);
        let again = lost.to_hold(&sent, false);
        assert_eq!(again, [Some(125), None, None, None, None, None, None], "from where it is by now");
    }

    #[test]
    fn a_joint_that_leaves_zero_degrees_is_stopped_at_once() {
        let joints = look([170, 90, 65, 90, 90, 90, 80], [0, 90, 65, 90, 90, 90, 80], 0, 1);
        assert_eq!(joints.to_hold(&NOTHING_SENT, false)[0], Some(0));
        assert!(joints.is_doubtful(Joint::ALL[0], false), "it may be start-up: look again");
        let at_rest = look([0, 90, 65, 90, 90, 90, 80], [0, 90, 65, 90, 90, 90, 80], 0, 0);
        assert!(!at_rest.is_doubtful(Joint::ALL[0], false), "at rest at 0 degrees it was measured there");
    }

    #[test]
    fn a_joint_that_is_not_measured_yet_is_not_sent_to_zero() {
        let joints = power_up([0; 7], 0, 0);
        assert_eq!(joints.to_hold(&NOTHING_SENT, false), [None; 7]);
        assert!(joints.is_doubtful(Joint::ALL[0], false));
        assert_eq!(joints.to_hold(&NOTHING_SENT, true)[0], Some(0), "after start-up 0 is 0 degrees");
        let another_is_missing = power_up([0; 7], 0b10, 0);
        assert_eq!(another_is_missing.to_hold(&NOTHING_SENT, false)[0], Some(0), "start-up is over");
    }

    #[test]
    fn a_target_of_start_up_is_replaced_as_soon_as_the_joint_is_measured() {
        let sent = [Some(Sent { degrees: 0, was_doubtful: true }); 7];
        let joints = look([0; 7], UP, 0, 0x7F);
        assert_eq!(joints.to_hold(&sent, false), UP.map(Some));
    }

    #[test]
    fn a_silent_joint_is_held_where_it_was_measured_last_and_never_at_zero() {
        let joints = look([170, 90, 170, 90, 90, 90, 80], [120, 90, 0, 90, 90, 90, 80], 0b101, 0);
        let held = joints.to_hold(&NOTHING_SENT, true);
        assert_eq!((held[0], held[2]), (Some(120), None));
    }

    #[test]
    fn a_step_does_not_begin_at_a_target_of_power_up() {
        let base = |joints: &JointSnapshot| joints.step_base(Joint::ALL[0]);
        assert_eq!(base(&power_up(UP, 0, 0)), Err(NoBase::PowerUpTarget { target: 90, present: 120 }));
        assert_eq!(base(&power_up([0; 7], 0, 0)), Err(NoBase::PowerUpTarget { target: 90, present: 0 }));
        assert_eq!(base(&power_up(UP, 1, 0)), Err(NoBase::Silent));
        assert_eq!(base(&power_up(UP, 0, 1)), Ok(90), "on its way there");
        assert_eq!(base(&power_up([92, 90, 65, 90, 90, 90, 80], 0, 0)), Ok(90), "it stands there");
        assert_eq!(base(&look([100, 90, 65, 90, 90, 90, 80], UP, 0, 0)), Ok(100), "no power-up value");
        assert_eq!(base(&look([0; 7], [0; 7], 0, 0)), Ok(0), "0 degrees is a position");
    }

    #[test]
    fn joints_that_are_left_out_are_not_written_to() {
        let frames = |left_out: &[u8]| {
            let value = |joint: Joint| (!left_out.contains(&joint.number())).then_some(joint.number());
            frames_for(&TARGET_POSITION, &Joint::ALL.map(value))
        };
        assert_eq!(frames(&[]), [(46, vec![1, 2, 3, 4, 5, 6, 7])]);
        assert_eq!(frames(&[3, 7]), [(46, vec![1, 2]), (49, vec![4, 5, 6])]);
        assert_eq!(frames(&[1, 2, 3, 4, 5, 6, 7]), []);
    }
}
