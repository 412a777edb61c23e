//! One arm for many programs: requests of all clients share the arm's line, and each client sees an arm of its own.
//!
//! ```text
//!   bytes ──▶ FrameClient ──▶ Hub ──▶ Line ──▶ frames to the arm
//!   bytes ◀── FrameClient ◀── Hub ◀── Line ◀── bytes of the arm
//! ```
//!
//! The hub and the clients in this crate read no clock and open no port: time and bytes are arguments.

#![forbid(unsafe_code)]

pub mod frame_client;
pub mod hub;

pub use frame_client::FrameClient;
pub use hub::{ClientId, Event, Hub, WholeRequest};
