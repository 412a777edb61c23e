//! The registers of the arm: 256 registers of one byte (docs/protocol.md, sections 3 and 4).
//!
//! ```text
//!  spec   the types of a row                       (no addresses)
//!    ▼
//!  map    THE TABLE: one row per register          (no values)
//!    ▼
//!  file   the current values, and the rules of     (no wire, no motion)
//!         a write
//! ```
//!
//! The register file, the journal's contents, the simulator's trace, the host tools and
//! `docs/registers.md` all use this one table.

pub mod file;
pub mod map;
pub mod spec;

pub use file::{Accepted, Image, OutOfRange, RegisterFile};
pub use map::MAP;
pub use spec::{Access, JOINTS, Joint, Range, Region, Register, Unit};
