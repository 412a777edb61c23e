//! System tests know bytes only: frames through a serial port, against the simulator, the firmware in an
//! emulator (`ARM=emulator`), the controller on this computer with servos behind a simulated USB adapter
//! (`ARM=adapter`), or whatever answers on `ARM_PORT`.
//!
//! ```text
//!   tests/*.rs ──▶ Bench ──▶ Line ──▶ serial port ──▶ OwnArm, one a test: may be killed, faulty, ...
//!                    │                           └──▶ ARM_PORT: one arm for all tests, one after another
//!                    └── Target: what can be done to the arm itself
//! ```
//!
//! Nothing here is shared with the product: frames, checksum and register numbers are written down a second
//! time, from `docs/protocol.md`, so that a mistake on one side shows on the other.
//!
//! A test that needs what its arm cannot do is skipped, by name and with the reason, on standard error. `cargo xtask
//! test` names the tests for each kind of arm instead, and sets `ARM_MEETS_ALL_NEEDS`: then it is a failure.

pub mod bench;
pub mod frames;
pub mod line;
pub mod own;
pub mod programs;
pub mod registers;
pub mod target;
pub mod terminal;

pub use bench::{Bench, Setup, near, with_arm};
pub use frames::{read_request, write_request};
pub use line::Line;
pub use target::Need;
