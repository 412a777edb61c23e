//! What the arm can be asked and told: 256 registers of one byte (docs/protocol.md, section 2).
//!
//! ```text
//!  spec   the words a row is written in            (no addresses)
//!    ▼
//!  map    THE TABLE: one row a register            (no values)
//!    ▼
//!  file   the current values, and who may change   (no wire, no motion)
//!         which of them when
//! ```
//!
//! The register file, the journal's contents, the simulator's trace, the host tools and
//! `docs/registers.md` all read the one table.

pub mod file;
pub mod map;
pub mod spec;

pub use file::{Accepted, Image, OutOfRange, RegisterFile};
pub use map::MAP;
pub use spec::{Access, JOINTS, Joint, Range, Region, Register, Unit};
