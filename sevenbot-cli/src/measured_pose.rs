//! The measured angles of the joints, as exactly as the arm tells them.

use serde::Serialize;
use sevenbot::cartesian::{AngleStep, TipPose};
use sevenbot::{Angle, Arm, Error, FineAngle};

/// Measured angles, joint 1 first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeasuredPose {
    angles: [FineAngle; 7],
    step: AngleStep,
}

/// Angles in degrees, joint 1 first.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum PositionDegrees {
    Whole([u8; 7]),
    Hundredths([f64; 7]),
}

impl MeasuredPose {
    /// From whole degrees.
    pub(crate) fn whole(positions: [u8; 7]) -> Self {
        let angles = positions.map(|degrees| Angle::from_register(degrees).into());
        Self { angles, step: AngleStep::WholeDegree }
    }

    /// Reads hundredths of a degree if the arm has them. Otherwise, and for joints without a measurement, takes `positions`.
    pub(crate) fn read(arm: &mut Arm, positions: [u8; 7]) -> Result<Self, Error> {
        let whole = Self::whole(positions);
        let Some(fine) = arm.fine_state_if_served()? else { return Ok(whole) };
        let mut angles = whole.angles;
        for (angle, measured) in angles.iter_mut().zip(fine.positions) {
            *angle = measured.unwrap_or(*angle);
        }
        Ok(Self { angles, step: AngleStep::ServoCount })
    }

    /// Tip, tool and wrist.
    pub(crate) fn tip_pose(&self) -> TipPose {
        TipPose::of_fine(self.angles)
    }

    /// The largest error of the tip that the resolution of the angles causes, in millimetres.
    pub(crate) fn rounding_mm(&self) -> f64 {
        TipPose::rounding_mm(self.angles, self.step)
    }

    /// The angles as the arm tells them.
    pub(crate) fn degrees(&self) -> PositionDegrees {
        match self.step {
            AngleStep::WholeDegree => {
                PositionDegrees::Whole(self.angles.map(|angle| angle.nearest().degrees()))
            }
            AngleStep::ServoCount => PositionDegrees::Hundredths(self.angles.map(FineAngle::degrees)),
        }
    }
}

impl PositionDegrees {
    /// The angles as text: whole degrees, or degrees with two decimals.
    pub(crate) fn texts(self) -> [String; 7] {
        match self {
            Self::Whole(degrees) => degrees.map(|degrees| degrees.to_string()),
            Self::Hundredths(degrees) => degrees.map(|degrees| format!("{degrees:.2}")),
        }
    }
}
