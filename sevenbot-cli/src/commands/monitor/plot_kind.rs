//! What the plot of the monitor shows: positions, velocities or loads.

use std::time::Duration;

use clap::ValueEnum;
use sevenbot::Joint;
use sevenbot::fine::FineState;

use super::sample::ArmSample;

/// What the plot shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlotKind {
    /// Measured positions, in degrees.
    #[default]
    Position,
    /// Velocities, in degrees per second.
    Velocity,
    /// Loads of the motors, in percent of the stall torque.
    Load,
}

impl PlotKind {
    /// The kind after the next press of `p`.
    pub(crate) const fn next(self) -> Self {
        match self {
            Self::Position => Self::Velocity,
            Self::Velocity => Self::Load,
            Self::Load => Self::Position,
        }
    }

    /// The name and the unit.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Position => "position, °",
            Self::Velocity => "velocity, °/s",
            Self::Load => "load, %",
        }
    }

    /// The ends of the axis, and its labels from the lower to the upper end.
    pub(crate) const fn axis(self) -> ([f64; 2], [&'static str; 3]) {
        match self {
            Self::Position => ([0.0, 180.0], ["0°", "90°", "180°"]),
            Self::Velocity => ([-200.0, 200.0], ["-200°/s", "0", "200°/s"]),
            Self::Load => ([-100.0, 100.0], ["-100 %", "0", "100 %"]),
        }
    }
}

/// The values of an earlier sample that the plot can show.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PastSample {
    pub(crate) time: Duration,
    positions: [u8; 7],
    fine: Option<FineState>,
}

impl From<&ArmSample> for PastSample {
    fn from(sample: &ArmSample) -> Self {
        Self { time: sample.time, positions: sample.joints.positions(), fine: sample.fine }
    }
}

impl PastSample {
    /// The value of a joint in the plot, in the unit of `kind`; `None` if the arm does not measure it.
    pub(crate) fn value(&self, kind: PlotKind, joint: Joint) -> Option<f64> {
        let index = usize::from(joint.index());
        let tenths = |values: [i16; 7]| values.get(index).map(|&value| f64::from(value) / 10.0);
        match kind {
            PlotKind::Position => self.positions.get(index).copied().map(f64::from),
            PlotKind::Velocity => tenths(self.fine?.velocities),
            PlotKind::Load => tenths(self.fine?.loads),
        }
    }
}
