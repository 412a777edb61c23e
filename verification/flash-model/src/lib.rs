//! A NOR flash for tests: stricter than a real one, and deterministic.
//!
//! - Programming clears bits, word by word. Programming a word twice with different values without an erase between them
//!   is an error, even if the first program was cut. A first value of all ones does not count.
//! - The power can be cut at any operation: one word programmed or one sector erased. [`ProgramTear`] and [`EraseTear`]
//!   list the states that a cut leaves. After a cut every access fails until [`Flash::power_up`].
//! - A *marginal* bit is a partly charged cell. It reads the same until the next power-up, then perhaps the opposite.
//! - A sector whose erase was cut half way may read as anything, even as blank. Programming it before a complete erase is an error.
//! - Erases can be forbidden, sectors and cells wear out, bits flip. An inert flash changes nothing, as in an emulator.
//!
//! The flash of a chip also has a [`Cache`], a [`FlashSupply`] and a [`Comparator`] that monitors the supply. A model of a chip
//! combines them with [`Flash`].
//!
//! The model does not know what is stored in it. It is cheap to clone, so that a test can try every continuation of a
//! state.
//!
//! ```
//! use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
//! use flash_model::{Error, Flash};
//!
//! let mut flash = Flash::<4096>::new(2);
//! flash.write(0, &[1, 2, 3, 4])?;
//! assert!(flash.write(0, &[5, 2, 3, 4]).is_err(), "a programmed word needs an erase first");
//! let mut bytes = [0; 4];
//! flash.read(0, &mut bytes)?;
//! assert_eq!(bytes, [1, 2, 3, 4]);
//! # Ok::<(), Error>(())
//! ```

mod cache;
mod error;
mod flash;
mod nor_flash;
mod power_cut;
mod random;
mod supply;

pub use cache::Cache;
pub use error::Error;
pub use flash::{Cut, Flash, Operation};
pub use power_cut::{EraseTear, ProgramTear};
pub use random::Random;
pub use supply::{Comparator, FlashSupply};

#[cfg(test)]
mod tests;
