//! The servo bus: the wire that connects seven SCS servos, from the master's side.
//!
//! ```text
//!   frame    frames of both directions (no time, no transactions)
//!     ▼
//!   bus      transactions, timeouts    (no angles, no registers of the arm)
//! ```

pub mod bus;
mod byte_time;
pub mod frame;
mod torque;

pub use bus::{Answer, Bus, HeldGoal, Outcome, Question};
pub use byte_time::ByteTime;
pub use frame::Reading;
pub use torque::{Torque, TorqueCodes};
