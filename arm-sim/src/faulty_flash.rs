//! A flash that refuses writes while it has a fault.

use core::fmt::{self, Display, Formatter};
use core::str::FromStr;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use crate::fault_count::FaultCount;

/// A fault of the settings storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FlashFault {
    /// The flash refuses every write and erase.
    Fails,
    /// The journal has no room: this project's controller refuses writes that change a setting
    /// ([D19](protocol_core::decisions#d19)).
    Full,
}

/// The word is not a fault of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("use flash=fails or flash=full")]
pub struct UnknownFlashFault;

impl FromStr for FlashFault {
    type Err = UnknownFlashFault;

    fn from_str(word: &str) -> Result<Self, UnknownFlashFault> {
        match word {
            "fails" => Ok(Self::Fails),
            "full" => Ok(Self::Full),
            _ => Err(UnknownFlashFault),
        }
    }
}

impl Display for FlashFault {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Fails => "fails",
            Self::Full => "full",
        })
    }
}

/// The error of a flash that can have a [`FlashFault`].
#[derive(Debug)]
pub enum FlashError<E> {
    /// [`FlashFault::Fails`] refuses the operation.
    Fault,
    /// The flash itself reports this error.
    Flash(E),
}

impl<E: NorFlashError> NorFlashError for FlashError<E> {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Fault => NorFlashErrorKind::Other,
            Self::Flash(error) => error.kind(),
        }
    }
}

/// A flash, with a fault or without.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct FaultyFlash<F> {
    pub(crate) flash: F,
    fails: bool,
    count: FaultCount,
}

impl<F> FaultyFlash<F> {
    /// The flash without a fault.
    pub(crate) const fn new(flash: F) -> Self {
        Self { flash, fails: false, count: FaultCount { effects: 0, occasions: 0 } }
    }

    /// Sets whether it refuses writes and erases, and resets the count of refused ones.
    pub(crate) fn set_fails(&mut self, fails: bool) {
        self.fails = fails;
        self.count = FaultCount::default();
    }

    /// The refused writes and erases.
    pub(crate) const fn count(&self) -> FaultCount {
        self.count
    }

    fn check<E>(&mut self) -> Result<(), FlashError<E>> {
        if self.fails {
            self.count.count(true);
            return Err(FlashError::Fault);
        }
        Ok(())
    }
}

impl<F: NorFlash> ErrorType for FaultyFlash<F> {
    type Error = FlashError<F::Error>;
}

impl<F: NorFlash> ReadNorFlash for FaultyFlash<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.flash.read(offset, bytes).map_err(FlashError::Flash)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: NorFlash> NorFlash for FaultyFlash<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.check()?;
        self.flash.erase(from, to).map_err(FlashError::Flash)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.check()?;
        self.flash.write(offset, bytes).map_err(FlashError::Flash)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flash::Flash;

    #[test]
    fn a_failing_flash_can_be_read_only() {
        let mut flash = FaultyFlash::new(Flash::in_memory());
        flash.write(0, &[1; 4]).unwrap();
        flash.set_fails(true);
        assert!(flash.write(4, &[1; 4]).is_err() && flash.erase(0, 16 * 1024).is_err());
        assert_eq!(flash.count(), FaultCount { effects: 2, occasions: 2 });
        let mut bytes = [0; 8];
        flash.read(0, &mut bytes).unwrap();
        assert_eq!(bytes, [1, 1, 1, 1, 255, 255, 255, 255]);
        flash.set_fails(false);
        flash.write(4, &[1; 4]).unwrap();
    }
}
