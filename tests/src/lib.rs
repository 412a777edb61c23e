//! What the system tests share. They use the product from outside only: through ports, sockets and programs. The arm of
//! [`with_arm`] is the simulator, the firmware in an emulator (`ARM=emulator`), the controller on this computer with servos
//! behind a simulated USB adapter (`ARM=adapter`), or the arm on `ARM_PORT`.
//!
//! ```text
//!   tests/system ──▶ TestArm ──▶ ArmClient ──▶ serial port ──▶ StartedArm: one for each test
//!                       │                                 └──▶ ExternalArm on ARM_PORT: one for all tests, in turn
//!                       └── ArmControl: power cycles, kills
//! ```
//!
//! The tests share no code with the product. Frames, checksum and register numbers are written from `docs/protocol.md`
//! again, so that a mistake on one side makes a test fail.
//!
//! A test whose arm lacks a capability is skipped, with its name and the reason on standard error. `cargo xtask test`
//! leaves out such tests by name and sets `ARM_MEETS_ALL_NEEDS`, which makes a skipped test a failure.

pub mod arm_client;
pub mod arm_control;
pub mod control;
pub mod frames;
pub mod multicast;
pub mod process;
pub mod programs;
pub mod random;
pub mod registers;
pub mod relay;
pub mod simulator;
pub mod started_arm;
pub mod terminal;
pub mod test_arm;
pub mod wait;

pub use arm_client::ArmClient;
pub use arm_control::Need;
pub use frames::{read_request, write_request};
pub use test_arm::{TestArm, TestSetup, near, with_arm};
