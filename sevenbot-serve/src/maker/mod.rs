//! The maker's WebSocket: JSON messages in place of frames (maker's firmware 2.1.4).
//!
//! ```text
//!   text ──▶ MakerCommand ──▶ MakerClient ──▶ Hub
//!   text ◀── answer  ◀── MakerClient ◀── Hub
//! ```

mod block;
pub mod client;
pub mod command;

pub use client::MakerClient;
pub use command::MakerCommand;
