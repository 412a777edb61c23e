//! Programs that behave badly, all at once, and what each of them may expect of the server all the same.
//!
//! ```text
//!   Visitor ──▶ Wire: pseudo-terminal, Unix socket, TCP, WebSocket ──▶ server ──▶ relay ──▶ simulator
//!      └── what it sent, and when ──▶ SentTargets ◀── what reached the arm ──────────┘
//! ```

mod frame_visits;
mod sent_targets;
mod visitor;
mod web_visits;
mod wire;

pub(crate) use visitor::{Chaos, Tally, visit};
pub(crate) use wire::{Security, WayIn};
