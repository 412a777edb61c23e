//! The registers of the arm: 256 registers of one byte (docs/protocol.md, sections 3, 4, 6 and 8 to 10).
//!
//! ```text
//!  joint, range, unit, spec   the types of a row              (no addresses)
//!    ▼
//!  map, map21           THE TABLES: one row per register    (no values)
//!    ▼
//!  rules                what a write of either map may do
//!    ▼
//!  accepted, file       the current values                  (no wire, no motion)
//! ```
//!
//! The maker has two maps, 2.2 and 2.1. The function code of a write tells its map
//! ([M1](crate::decisions#m1)); reads are one union of both ([M3](crate::decisions#m3)). The register file, the
//! journal's contents, the simulator's trace, the host tools and `docs/registers.md` all use these two tables.

mod accepted;
pub mod file;
pub mod joint;
pub mod map;
pub mod map21;
pub mod range;
mod rules;
pub mod spec;
mod unit;

pub use accepted::Accepted;
pub use file::{Image, RegisterFile};
pub use joint::{JOINTS, Joint};
pub use map::MAP;
pub use map21::{MAP_21, Map};
pub use range::Range;
pub use rules::Refused;
pub use spec::{Access, Region, Register};
pub use unit::Unit;
