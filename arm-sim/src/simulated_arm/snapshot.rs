//! Sets an arm back to an earlier copy of it.

use alloc::vec;

use embedded_storage::nor_flash::NorFlash;

use super::SimulatedArm;

impl<F: NorFlash + Clone, B: Clone, C: Clone> SimulatedArm<F, B, C> {
    /// Makes the arm what `snapshot`, an earlier copy of it, was: also its time, its faults and the bytes on the host line.
    /// It keeps its tap and its recorder. The settings are programmed again if they differ, so that a file has them, too.
    ///
    /// # Errors
    /// The settings cannot be read or programmed. The arm is unchanged, and the cells of its flash may be erased.
    pub fn restore(&mut self, snapshot: &Self) -> Result<(), F::Error> {
        let mut copy = snapshot.clone();
        program(&mut self.settings.flash_mut().flash, &mut copy.settings.flash_mut().flash)?;
        copy.tap = core::mem::take(&mut self.tap);
        copy.recorder = core::mem::take(&mut self.recorder);
        *self = copy;
        Ok(())
    }

    /// Is everything that is done to the arm recorded?
    #[must_use]
    pub const fn is_recorded(&self) -> bool {
        !self.recorder.is_empty()
    }
}

/// Programs the content of `wanted` into `flash`, unless it is there.
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
