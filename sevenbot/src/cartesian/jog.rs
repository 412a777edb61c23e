//! Small steps of the tip along axes, with the direction of the tool kept: jogging.
//!
//! Poses in whole degrees are millimetres apart. So a jog keeps the exact position from step to step, and rounding errors do
//! not add up.

use kinematics::{Frames, forward};

use super::Vector;
use super::guard::{Guard, JointPath, PathBreach};
use super::refusal::TipRefusal;
use super::target::TipTarget;
use crate::units::Angle;

/// The axes in which a step of a jog is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JogAxes {
    /// The axes of the base: x to the right, y forward, z up.
    Base,
    /// The axes of the tool: x in the direction of the disc, z along the tool away from the wrist.
    Tool,
}

/// Where jogging has brought the tip.
///
/// ```
/// use sevenbot::Angle;
/// use sevenbot::cartesian::{Jog, JogAxes, Vector};
///
/// let targets = [90, 91, 110, 90, 135, 90, 80].map(Angle::from_register);
/// let jog = Jog::step(None, targets, JogAxes::Base, Vector::new(5.0, 0.0, 0.0), None)?;
/// assert_eq!(jog.targets[0].degrees(), 88);
/// # Ok::<(), sevenbot::cartesian::JogRefusal>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jog {
    /// The exact position of the tip, in millimetres.
    pub tip: Vector,
    /// The direction of the tool, of length 1.
    pub tool: Vector,
    /// The targets in whole degrees, joint 1 first. Joints 6 and 7 keep theirs.
    pub targets: [Angle; 7],
}

/// Why [`Jog::step`] refuses a step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JogRefusal {
    /// The end of the step is out of reach, or the guard does not allow it.
    #[error("{}", .0.reason())]
    End(Box<TipRefusal>),
    /// The guard does not allow the way there.
    #[error(transparent)]
    Way(PathBreach),
}

impl Jog {
    /// A step by `millimetres`. It starts at the exact position of the jog `before` if `targets` equals the targets of that
    /// jog, otherwise at the position of `targets`. The guard checks the end and the way there; `None`: no guard.
    ///
    /// # Errors
    /// The new position is out of reach, or the guard does not allow it or the way there.
    pub fn step(
        before: Option<Self>,
        targets: [Angle; 7],
        axes: JogAxes,
        millimetres: Vector,
        guard: Option<&Guard>,
    ) -> Result<Self, JogRefusal> {
        let [t1, t2, t3, t4, t5, sixth, seventh] = targets;
        let angles = [t1, t2, t3, t4, t5, sixth].map(|angle| f64::from(angle.degrees()));
        let Frames { hand, .. } = forward(angles);
        let here = before.filter(|jog| jog.targets == targets);
        let (tip, tool) = here.map_or((hand.tip, hand.tool), |jog| (jog.tip, jog.tool));
        let way = match axes {
            JogAxes::Base => millimetres,
            JogAxes::Tool => {
                hand.disc * millimetres.x + tool.cross(hand.disc) * millimetres.y + tool * millimetres.z
            }
        };
        let tip = tip + way;
        let target = TipTarget::guarded(tip, tool, guard).map_err(|why| JogRefusal::End(Box::new(why)))?;
        let [a1, a2, a3, a4, a5, _] = angles;
        let way = JointPath::together([a1, a2, a3, a4, a5], target.degrees.map(f64::from));
        guard.map_or(Ok(()), |guard| guard.check_path(&way)).map_err(JogRefusal::Way)?;
        let [t1, t2, t3, t4, t5] = target.degrees.map(Angle::from_register);
        Ok(Self { tip, tool, targets: [t1, t2, t3, t4, t5, sixth, seventh] })
    }
}

#[cfg(test)]
mod tests {
    use super::super::TipPose;
    use super::*;

    const AT_WORK: [u8; 7] = [90, 91, 110, 90, 135, 90, 80];

    fn jogged(count: usize, axes: JogAxes, step: [f64; 3]) -> (TipPose, Jog) {
        let start = AT_WORK.map(Angle::from_register);
        let [x, y, z] = step;
        let mut jog: Option<Jog> = None;
        for _ in 0..count {
            let targets = jog.map_or(start, |jog| jog.targets);
            jog = Some(Jog::step(jog, targets, axes, Vector::new(x, y, z), None).expect("within reach"));
        }
        (TipPose::of(start), jog.expect("a step"))
    }

    #[test]
    fn many_small_steps_add_up_exactly() {
        let (start, jog) = jogged(60, JogAxes::Base, [1.0, 0.0, 0.5]);
        assert!((jog.tip - start.tip - Vector::new(60.0, 0.0, 30.0)).length() < 1e-9);
        assert!((TipPose::of(jog.targets).tip - jog.tip).length() < 2.5, "whole degrees");
        assert_eq!([jog.targets[5].degrees(), jog.targets[6].degrees()], [90, 80]);
        let (start, jog) = jogged(60, JogAxes::Base, [-1.0, 0.0, 0.0]);
        assert!((TipPose::of(jog.targets).tip - start.tip).x < -57.0);
    }

    #[test]
    fn the_axes_of_the_tool_are_those_of_the_hand() {
        let (start, jog) = jogged(4, JogAxes::Tool, [0.0, 0.0, -5.0]);
        assert!((jog.tip - start.tip + start.tool * 20.0).length() < 1e-9, "back from the table");
        let (start, jog) = jogged(1, JogAxes::Tool, [7.0, 0.0, 0.0]);
        let moved = jog.tip - start.tip;
        assert!((moved.length() - 7.0).abs() < 1e-9 && moved.dot(start.tool).abs() < 1e-9);
    }

    #[test]
    fn an_arm_that_was_sent_elsewhere_jogs_from_there() {
        let (_, jog) = jogged(3, JogAxes::Base, [1.0, 0.0, 0.0]);
        let elsewhere = [80, 91, 110, 90, 135, 90, 80].map(Angle::from_register);
        let next = Jog::step(Some(jog), elsewhere, JogAxes::Base, Vector::new(0.0, 0.0, 5.0), None);
        let moved = next.expect("within reach").tip - TipPose::of(elsewhere).tip;
        assert!((moved - Vector::new(0.0, 0.0, 5.0)).length() < 1e-9);
    }

    #[test]
    fn a_step_out_of_reach_is_refused() {
        let start = AT_WORK.map(Angle::from_register);
        assert!(Jog::step(None, start, JogAxes::Base, Vector::new(0.0, 500.0, 0.0), None).is_err());
    }

    #[test]
    fn steps_down_end_above_the_table() {
        let (guard, down) = (Guard::above(30.0), Vector::new(0.0, 0.0, -5.0));
        let mut jog: Option<Jog> = None;
        let refused = (0..100).find_map(|_| {
            let targets = jog.map_or(AT_WORK.map(Angle::from_register), |jog| jog.targets);
            match Jog::step(jog, targets, JogAxes::Base, down, Some(&guard)) {
                Ok(next) => {
                    assert!(TipPose::of(next.targets).tip.z >= 29.9, "{next:?}");
                    jog = Some(next);
                    None
                }
                Err(refusal) => Some(refusal.to_string()),
            }
        });
        let refused = refused.expect("the table is there");
        assert!(refused.contains("below the table at z = 30 mm"), "{refused}");
        assert!((30.0..36.0).contains(&jog.expect("a step").tip.z), "{jog:?}");
    }
}
