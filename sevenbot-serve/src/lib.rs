//! One arm for many programs: requests of all clients share the arm's line, and each client sees an arm of its own.
//!
//! ```text
//!   bytes ──▶ FrameClient ──▶ Hub ──▶ Line ──▶ frames to the arm
//!   bytes ◀── FrameClient ◀── Hub ◀── Line ◀── bytes of the arm
//! ```
//!
//! The hub and the clients read no clock and open no port: time and bytes are arguments. [`server`] connects them to a
//! serial port, pseudo-terminals and sockets.

#![forbid(unsafe_code)]

pub mod frame_client;
pub mod hub;
pub mod maker;
#[cfg(target_os = "linux")]
pub mod server;
#[cfg(target_os = "linux")]
mod token;

pub use frame_client::FrameClient;
pub use hub::{ClientId, Event, Hub, WholeRequest};
pub use maker::MakerClient;
