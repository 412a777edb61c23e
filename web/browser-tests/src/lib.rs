//! The page in a real browser.
//!
//! ```text
//!   host-sim ◀── serial port ── sevenbot view ◀── HTTP, WebSocket ── Chromium ◀── DevTools protocol ── test
//! ```
//!
//! Input is made of real events: keys, mouse buttons and fingers. A test looks at the page as its user does, by pixels and by
//! the accessibility tree, and compares with the numbers that the page's module exports. Firefox has one test of its own.

pub mod browser;
pub mod connection;
pub mod firefox;
pub mod input;
pub mod page;
pub mod picture;
pub mod viewed;

pub use page::Page;
pub use viewed::Viewed;
