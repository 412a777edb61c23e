//! The servo bus: the wire that connects seven SCS servos, from the master's side.
//!
//! ```text
//!   frame    frames of both directions (no time, no turns)
//!     ▼
//!   bus      transactions, timeouts    (no angles, no registers of the arm)
//! ```

pub mod bus;
pub mod frame;
mod torque;

pub use bus::{Bus, Outcome};
pub use frame::Reading;
pub use torque::{Torque, TorqueCodes};
