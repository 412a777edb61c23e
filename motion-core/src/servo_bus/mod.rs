//! The servo bus: seven SCS servos on one wire, both ends of it.
//!
//! ```text
//!   frame    what goes over the wire, either way      (no time, no turns)
//!     ▼
//!   bus      whose turn it is: the master's end       (no angles, no registers of the arm)
//!   servo    the servo's end, for simulators          (no motor)
//! ```

pub mod bus;
pub mod frame;
pub mod servo;

pub use bus::{Bus, Outcome, Torque, TorqueCodes};
pub use frame::Reading;
