//! Restores an arm to an earlier copy of it.

use alloc::vec;

use embedded_storage::nor_flash::NorFlash;

use super::SimulatedArm;

impl<F: NorFlash + Clone, B: Clone, C: Clone> SimulatedArm<F, B, C> {
    /// Restores the state of `snapshot`, an earlier copy of the arm, with its time, its faults and the bytes on the host line.
    /// The tap and the recorder stay. Settings that differ are programmed into the flash again, so that a settings file gets
    /// them, too.
    ///
    /// # Errors
    /// The settings cannot be read or programmed. The arm itself is unchanged then, but its flash may be erased.
    pub fn restore(&mut self, snapshot: &Self) -> Result<(), F::Error> {
        let mut copy = snapshot.clone();
        program(&mut self.settings.flash_mut().flash, &mut copy.settings.flash_mut().flash)?;
        copy.tap = core::mem::take(&mut self.tap);
        copy.recorder = core::mem::take(&mut self.recorder);
        *self = copy;
        Ok(())
    }

    /// Does the arm have a recorder?
    #[must_use]
    pub const fn is_recorded(&self) -> bool {
        !self.recorder.is_empty()
    }
}

/// Programs the content of `wanted` into `flash`, unless `flash` already has it.
fn program<F: NorFlash>(flash: &mut F, wanted: &mut F) -> Result<(), F::Error> {
    let mut bytes = vec![0; flash.capacity()];
    let mut present = bytes.clone();
    wanted.read(0, &mut bytes)?;
    flash.read(0, &mut present)?;
    if present == bytes {
        return Ok(());
    }
    flash.erase(0, u32::try_from(bytes.len()).unwrap_or(u32::MAX))?;
    flash.write(0, &bytes)
}
