//! The page that simulates, shows and drives a 7Bot V2 arm in a browser.
//!
//! ```text
//!   Source: simulator, WebSocket, Web Serial
//!      │ ▲  bytes
//!      ▼ │
//!   Client: frames ──▶ registers ──▶ ArmState ──▶ scene, plots, panels
//!        ▲
//!        └── commands ◀── events of a person
//! ```
//!
//! Only `app`, the drawing code in `scene` and `plots`, and the sources `serial` and `socket` call the browser. Everything else
//! is plain Rust, and is tested on the host.

#![forbid(unsafe_code)]

#[cfg(target_arch = "wasm32")]
mod app;
pub mod arm_state;
pub mod class;
pub mod client;
mod confirmed;
pub mod exercise;
mod interruptions;
pub mod movement;
pub mod park;
pub mod plots;
pub mod preview;
mod problems_in_chinese;
pub mod program;
pub mod recorder;
pub mod scene;
pub mod source;
pub mod stop;
#[cfg(test)]
mod tab;
pub mod texts;
pub mod time_line;
pub mod words;
