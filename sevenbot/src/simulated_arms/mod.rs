//! Many simulated arms that step together, for learning.
//!
//! ```text
//!   targets (n × 7) ──▶ each arm: a frame, time, a read ──▶ observations (n × 32)
//!                       └─ groups of arms, each taken by the next free thread
//! ```
//!
//! The controllers parse real frames, and an observation is the reply to a read. The line takes no time, so without a fault the
//! reply is there at once. Each arm has a time, faults and a seed of its own, so the results do not depend on the number of
//! threads.
//!
//! ```
//! use sevenbot::simulated_arms::{POSITIONS, SimulatedArms, WIDTH};
//! use std::num::NonZeroUsize;
//! use std::time::Duration;
//!
//! let mut arms = SimulatedArms::new(&[1, 2, 3], NonZeroUsize::MIN);
//! let targets = [[100.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]; 3];
//! let mut seen = [[0.0; WIDTH]; 3];
//! for _ in 0..50 {
//!     let step = Duration::from_millis(20);
//!     arms.step(Some(targets.as_flattened()), step, seen.as_flattened_mut())?;
//! }
//! let base = seen[0][POSITIONS][0];
//! assert!((base - 100.0_f64).abs() < 1.0, "{base}");
//! # Ok::<(), sevenbot::simulated_arms::StepError>(())
//! ```

use std::num::NonZeroUsize;
use std::time::Duration;

use arm_sim::{Simulation, SimulationConfig};
use protocol_core::registers::JOINTS;
use protocol_core::time;

use crate::fine_angle::FineAngle;

mod observation;
mod one_arm;
mod outside;
mod step_error;
#[cfg(test)]
mod tests;
mod threads;

pub use observation::{AGE, BLOCKED, LOADS, Number, POSITIONS, TIP, VELOCITIES, WIDTH};
use one_arm::SteppedArm;
pub use outside::{DRIVES, MEASURED, SET_POINTS, SET_VELOCITIES, WANTED};
pub use step_error::StepError;
use threads::share;

/// The number of arms in a group, which a thread takes at a time. A step of a group takes some 100 microseconds. A thread needs
/// much less time to take the next group.
const GROUP: usize = 16;
/// The time from power-up to the first step: the servos start, and the joints are measured.
const START: time::Duration = time::Duration::from_millis(1_000);

/// Arms that step together, each in a simulation of its own.
#[derive(Clone, Debug)]
pub struct SimulatedArms {
    arms: Vec<SteppedArm>,
    /// An arm that has just started.
    started: Simulation,
    threads: NonZeroUsize,
}

impl SimulatedArms {
    /// An arm for each seed. The seed determines the random faults of the arm's line. At most `threads` threads step the arms.
    #[must_use]
    pub fn new(seeds: &[u64], threads: NonZeroUsize) -> Self {
        let mut started =
            Simulation::new(SimulationConfig { is_paced: false, ..SimulationConfig::default() });
        started.advance(START);
        let arms = seeds.iter().map(|&seed| SteppedArm::new(started.clone(), seed)).collect();
        let mut arms = Self { arms, started, threads };
        arms.reset(None, None);
        arms
    }

    /// The number of arms: one for each seed.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.arms.len()
    }

    /// Sends each arm its seven targets in degrees as the next point of a stream, lets `time` pass, reads each arm's state, and
    /// writes it into [`WIDTH`] numbers. Without targets the arms get no frame but the read.
    ///
    /// # Errors
    /// A target is out of range (the first one is named), or the time or a length is wrong. Then nothing is done.
    pub fn step<T: Number, N: Number>(
        &mut self,
        targets: Option<&[T]>,
        time: Duration,
        observations: &mut [N],
    ) -> Result<(), StepError> {
        let milliseconds = milliseconds(time).ok_or(StepError::Time(time))?;
        self.check_length(observations.len(), WIDTH)?;
        targets.map_or(Ok(()), |targets| self.check(targets))?;
        let rows = observations.chunks_mut(GROUP * WIDTH);
        // Without targets each group gets an empty slice, and no arm gets targets.
        let targets = targets.unwrap_or_default().chunks(GROUP * JOINTS);
        let targets = targets.chain(std::iter::repeat(&[][..]));
        let threads = self.threads.get().min(self.arms.len().div_ceil(GROUP));
        let groups = self.arms.chunks_mut(GROUP).zip(rows).zip(targets);
        share(threads, groups, |((arms, rows), targets)| {
            let mut targets = targets.as_chunks::<JOINTS>().0.iter();
            for (arm, row) in arms.iter_mut().zip(rows.chunks_mut(WIDTH)) {
                arm.step(targets.next().and_then(fine), milliseconds);
                arm.write_row(row);
            }
        });
        Ok(())
    }

    /// Sends each arm its seven targets in degrees as the next point of a stream of this period. No time passes.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn send<T: Number>(&mut self, targets: &[T], period: Duration) -> Result<(), StepError> {
        let milliseconds = milliseconds(period).ok_or(StepError::Time(period))?;
        self.check(targets)?;
        for (arm, targets) in self.arms.iter_mut().zip(targets.as_chunks::<JOINTS>().0) {
            fine(targets).into_iter().for_each(|targets| arm.send(targets, milliseconds));
        }
        Ok(())
    }

    /// Lets another simulation move the joints. Gives each arm the measurements of that simulation ([`MEASURED`] numbers), lets
    /// `time` pass, and then writes what the servos aim at ([`WANTED`] numbers).
    ///
    /// ```
    /// use sevenbot::simulated_arms::{DRIVES, MEASURED, SET_POINTS, SimulatedArms, WANTED};
    /// use std::num::NonZeroUsize;
    /// use std::time::Duration;
    ///
    /// let mut arms = SimulatedArms::new(&[1], NonZeroUsize::MIN);
    /// let (mut measured, mut wanted) = ([0.0; MEASURED], [0.0; WANTED]);
    /// measured[..7].copy_from_slice(&[90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0]);
    /// arms.send(&[100.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0], Duration::from_millis(20))?;
    /// for _ in 0..100 {
    ///     arms.exchange(&measured, Duration::from_millis(2), &mut wanted)?;
    ///     // A simulation whose joints are always where they should be.
    ///     measured[..14].copy_from_slice(&wanted[..14]);
    /// }
    /// assert!((wanted[SET_POINTS][0] - 100.0_f64).abs() < 0.3, "{wanted:?}");
    /// assert_eq!(wanted[DRIVES], [1.0; 7]);
    /// # Ok::<(), sevenbot::simulated_arms::StepError>(())
    /// ```
    ///
    /// # Errors
    /// A measurement is refused ([`StepError::Measured`], the first one is named), or the time or a length is wrong. Then nothing
    /// is done.
    pub fn exchange<T: Number, N: Number>(
        &mut self,
        measured: &[T],
        time: Duration,
        wanted: &mut [N],
    ) -> Result<(), StepError> {
        let milliseconds = whole_milliseconds(time).ok_or(StepError::ExchangeTime(time))?;
        self.check_length(measured.len(), MEASURED)?;
        self.check_length(wanted.len(), WANTED)?;
        outside::check(measured)?;
        let time = time::Duration::from_millis(milliseconds.into());
        let (measured, wanted) = (measured.chunks(GROUP * MEASURED), wanted.chunks_mut(GROUP * WANTED));
        let threads = self.threads.get().min(self.arms.len().div_ceil(GROUP));
        let groups = self.arms.chunks_mut(GROUP).zip(measured).zip(wanted);
        share(threads, groups, |((arms, measured), wanted)| {
            let rows = measured.chunks(MEASURED).zip(wanted.chunks_mut(WANTED));
            for (arm, (measured, wanted)) in arms.iter_mut().zip(rows) {
                outside::exchange(&mut arm.simulation, measured, time, wanted);
            }
        });
        Ok(())
    }

    /// Reads each arm's state, and writes it into [`WIDTH`] numbers. No time passes.
    ///
    /// # Errors
    /// `observations` has the wrong length.
    pub fn read<N: Number>(&mut self, observations: &mut [N]) -> Result<(), StepError> {
        self.check_length(observations.len(), WIDTH)?;
        self.arms.iter_mut().for_each(SteppedArm::observe);
        self.observe(observations)
    }

    fn check_length(&self, given: usize, each: usize) -> Result<(), StepError> {
        let wanted = self.arms.len().saturating_mul(each);
        if given == wanted { Ok(()) } else { Err(StepError::Length { given, wanted }) }
    }

    fn check<T: Number>(&self, targets: &[T]) -> Result<(), StepError> {
        self.check_length(targets.len(), JOINTS)?;
        let degrees = targets.iter().map(|target| target.widen());
        let wrong = degrees.enumerate().find(|(_, degrees)| FineAngle::from_degrees(*degrees).is_none());
        wrong.map_or(Ok(()), |(index, degrees)| {
            Err(StepError::Target { arm: index / JOINTS, joint: index % JOINTS + 1, degrees })
        })
    }

    /// Writes the last known state of each arm into [`WIDTH`] numbers, without a read. No time passes.
    ///
    /// # Errors
    /// `observations` has the wrong length.
    pub fn observe<N: Number>(&self, observations: &mut [N]) -> Result<(), StepError> {
        self.check_length(observations.len(), WIDTH)?;
        self.arms.iter().zip(observations.chunks_mut(WIDTH)).for_each(|(arm, row)| arm.write_row(row));
        Ok(())
    }

    /// Makes the arms of the mask, or all, copies of `other`; `None`: of an arm that has just started. Faults and loads are
    /// copied, too. Each arm keeps its seed.
    pub fn reset(&mut self, mask: Option<&[bool]>, other: Option<&Simulation>) {
        let other = other.unwrap_or(&self.started);
        masked(&mut self.arms, mask).for_each(|(_, arm)| arm.become_copy(other));
    }

    /// Calls `work` for each arm of the mask, or for all, with the arm's number from 0.
    pub fn each(&mut self, mask: Option<&[bool]>, mut work: impl FnMut(usize, &mut Simulation)) {
        masked(&mut self.arms, mask).for_each(|(index, arm)| work(index, &mut arm.simulation));
    }

    /// Sets the seed of an arm's line faults. It takes effect at the arm's next reset.
    pub fn set_seed(&mut self, arm: usize, seed: u64) {
        self.arms.get_mut(arm).into_iter().for_each(|arm| arm.seed = seed);
    }

    /// Writes registers of the arms of the mask, or of all, in one frame each. An arm refuses a frame with a value out of range
    /// (D16), without an error here.
    pub fn write(&mut self, mask: Option<&[bool]>, address: u8, values: &[u8]) {
        masked(&mut self.arms, mask).for_each(|(_, arm)| arm.write(address, values));
    }

    /// An arm by its number, from 0.
    #[must_use]
    pub fn arm(&self, index: usize) -> Option<&Simulation> {
        self.arms.get(index).map(|arm| &arm.simulation)
    }
}

/// The arms of the mask, or all, with their numbers.
fn masked<'a>(
    arms: &'a mut [SteppedArm],
    mask: Option<&'a [bool]>,
) -> impl Iterator<Item = (usize, &'a mut SteppedArm)> {
    let is_chosen = move |index: usize| mask.is_none_or(|mask| mask.get(index) == Some(&true));
    arms.iter_mut().enumerate().filter(move |(index, _)| is_chosen(*index))
}

/// The targets in hundredths of a degree; `None` if one is out of range.
fn fine<T: Number>(degrees: &[T; JOINTS]) -> Option<[FineAngle; JOINTS]> {
    let [a, b, c, d, e, f, g] = degrees.map(|degrees| FineAngle::from_degrees(degrees.widen()));
    Some([a?, b?, c?, d?, e?, f?, g?])
}

/// The time of a step in milliseconds; `None` if it is no set-point period ([D23](protocol_core::decisions#d23)).
fn milliseconds(time: Duration) -> Option<u16> {
    whole_milliseconds(time).filter(|time| *time >= 5)
}

/// The milliseconds of a time; `None` if they are not whole, or not 1 to 1000.
fn whole_milliseconds(time: Duration) -> Option<u16> {
    let milliseconds = u16::try_from(time.as_millis()).ok().filter(|time| (1..=1_000).contains(time))?;
    (Duration::from_millis(milliseconds.into()) == time).then_some(milliseconds)
}
