//! The page in a real browser.
//!
//! ```text
//!   host-sim ◀── serial port ── sevenbot view ◀── HTTP, WebSocket ── Chromium ◀── DevTools protocol ── test
//! ```
//!
//! Keys, mouse buttons and fingers cause real events of the browser. Scripts set lists, some fields, and all sliders at once, and
//! make some of the clicks. A test looks at the page as its user does, by pixels and by the accessibility tree, and compares with
//! the numbers that the page's module exports. Firefox has one test of its own.
//!
//! No test may depend on the speed of the machine. Two variables help to find a test that does: with `SLOW_PAGE=10` the page
//! has a tenth of the processor. With `LATE_TEST=1000` each step of a test is up to 1,000 ms late, while the arm goes on.

pub mod browser;
pub mod class_run;
pub mod connection;
pub mod firefox;
pub mod input;
pub mod page;
pub mod picture;
pub mod viewed;

pub use class_run::ClassRun;
pub use page::Page;
pub use viewed::Viewed;
