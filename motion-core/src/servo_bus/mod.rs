//! The servo bus: seven SCS servos on one wire, both ends of it.
//!
//! ```text
//!     FF FF │ id │ len │ instruction or error │ parameters .. │ checksum
//! ```

pub mod frame;
pub mod servo;
