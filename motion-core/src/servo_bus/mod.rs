//! The servo bus: both ends of the wire that connects seven SCS servos.
//!
//! ```text
//!   frame    frames of both directions                (no time, no turns)
//!     ▼
//!   bus      the master's end: transactions, timeouts (no angles, no registers of the arm)
//!   servo    the servo's end, for simulators          (no motor)
//! ```

pub mod bus;
pub mod frame;
pub mod servo;
mod torque;

pub use bus::{Bus, Outcome};
pub use frame::Reading;
pub use torque::{Torque, TorqueCodes};
