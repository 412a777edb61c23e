//! Typed access to the extended block, registers 128 to 191: hundredths of a degree, velocities, loads
//! ([D21](protocol_core::decisions#d21) to [D26](protocol_core::decisions#d26)).

use protocol_core::registers::map::{
    EXTENDED_VERSION, FINE_POSITION, FINE_TARGET, HOST_WATCHDOG, SET_POINT_PERIOD,
};
use protocol_core::registers::map21::Map;

use crate::arm::Arm;
use crate::checked_write::WriteError;
use crate::error::Error;
use crate::fine_angle::FineAngle;
pub use crate::fine_state::{FineState, FineTargets};
use crate::identity::Firmware;
use crate::joints::frames_of;
use host_link::{Snapshot, Span};

/// The set-point period and the watchdog of a stream. A program that ends its stream puts both back.
const PERIOD_AND_WATCHDOG: Span = Span::between(&SET_POINT_PERIOD, &HOST_WATCHDOG);

impl Arm {
    /// Does the arm have the extended block? Only this project's firmware has it, and only in map 2.2.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn has_extended_block(&mut self) -> Result<bool, Error> {
        if self.identity().firmware() != Firmware::Ours || self.map() != Map::V22 {
            return Ok(false);
        }
        Ok(self.read_span(Span::of(&EXTENDED_VERSION))?.has_extended_block())
    }

    /// Positions, velocities and loads. Only for an arm with the extended block.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn fine_state(&mut self) -> Result<FineState, Error> {
        Ok(FineState::new(&self.read_span(FineState::REGISTERS)?))
    }

    /// As [`Arm::fine_state`], from any arm; `None` without the extended block.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn fine_state_if_served(&mut self) -> Result<Option<FineState>, Error> {
        if self.identity().firmware() != Firmware::Ours || self.map() != Map::V22 {
            return Ok(None);
        }
        let snapshot = self.read_span(Span::between(&FINE_POSITION, &EXTENDED_VERSION))?;
        Ok(snapshot.has_extended_block().then(|| FineState::new(&snapshot)))
    }

    /// The targets in hundredths of a degree, joint 1 first. Only for an arm with the extended block.
    ///
    /// # Errors
    /// As [`Arm::read`].
    pub fn fine_targets(&mut self) -> Result<[FineAngle; 7], Error> {
        let snapshot = self.read_span(Span::of(&FINE_TARGET))?;
        let limit = FineAngle::MAX_HUNDREDTHS;
        Ok(snapshot.words(&FINE_TARGET).map(|word| {
            FineAngle::from_hundredths(word.min(limit))
                .unwrap_or(FineAngle::from(crate::Angle::from_register(0)))
        }))
    }

    /// Sets targets and reads them back. The joints approach them by speed or time, as they approach whole degrees
    /// ([D23](protocol_core::decisions#d23)): the set-point period of another program is switched off for these frames, and
    /// restored afterwards. Only for an arm with the extended block.
    ///
    /// # Errors
    /// As [`Arm::write_checked`].
    pub fn set_fine_targets_checked(&mut self, targets: &FineTargets) -> Result<(), WriteError> {
        self.without_set_point_period(|arm| arm.write_all_checked(&fine_frames(targets)))
    }

    /// Runs `work` with the set-point period 0, so that fine targets are not points of a stream (D23). Then restores the
    /// period, also after a failure, unless the program that streams has ended its stream meanwhile. Only for an arm with
    /// the extended block.
    pub(crate) fn without_set_point_period<T>(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<T, WriteError>,
    ) -> Result<T, WriteError> {
        let before = self.read_span(PERIOD_AND_WATCHDOG)?;
        if before.word(SET_POINT_PERIOD.address) == 0 {
            return work(self);
        }
        self.write(SET_POINT_PERIOD.address, &[0, 0])?;
        let done = work(self);
        let restored = self.restore_period(&before);
        let done = done?;
        restored?;
        Ok(done)
    }

    fn restore_period(&mut self, before: &Snapshot) -> Result<(), WriteError> {
        if self.is_stream_over(before)? {
            return Ok(());
        }
        self.write_checked(SET_POINT_PERIOD.address, &before.word(SET_POINT_PERIOD.address).to_le_bytes())?;
        // The stream may have ended between the read and the write.
        if self.is_stream_over(before)? {
            self.write_checked(SET_POINT_PERIOD.address, &[0, 0])?;
        }
        Ok(())
    }

    /// Has the program that streams ended its stream? Then it has changed the watchdog since `before`, unless its stream had none.
    fn is_stream_over(&mut self, before: &Snapshot) -> Result<bool, WriteError> {
        let watchdog = |registers: &Snapshot| registers.byte(&HOST_WATCHDOG);
        Ok(watchdog(&self.read_span(PERIOD_AND_WATCHDOG)?) != watchdog(before))
    }
}

/// One write for each run of neighbouring joints with a target, joint 1 first: address and values.
#[must_use]
pub fn fine_frames(targets: &FineTargets) -> Vec<(u8, Vec<u8>)> {
    frames_of(&FINE_TARGET, &targets.map(|target| target.map(|angle| angle.hundredths().to_le_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_without_a_target_are_not_written() {
        let angle = FineAngle::from_hundredths(0x0102);
        assert_eq!(fine_frames(&[None; 7]), []);
        assert_eq!(fine_frames(&[angle; 7]), [(128, [2, 1].repeat(7))]);
        let some = [None, angle, angle, None, None, None, angle];
        assert_eq!(fine_frames(&some), [(130, vec![2, 1, 2, 1]), (140, vec![2, 1])]);
    }
}
