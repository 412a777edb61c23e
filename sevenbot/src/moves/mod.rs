//! Moves that take a while: to a pose, along a recording, guided by hand into a recording, or into a pose for parking. Also
//! a watched hold, and writes of registers that may move the arm.
//!
//! ```text
//!   Arm::driven_joints ──▶ JointMove::begin ──▶ finish ──▶ positions        ┐
//!   Recording ──▶ Player::play ──▶ approach, points, last pose ──▶ measured ├── Observer: progress, and whether to go on
//!   Arm::with_reports ──▶ Recorder::next ──▶ moments                        ┘
//! ```
//!
//! Calls that wait use the clock of the arm's line.

mod approach;
mod drive;
mod error;
mod hold_watch;
mod joint_move;
mod observer;
mod pace;
mod park;
mod player;
mod recorder;
mod register_write;
mod report_clock;
mod report_session;
mod tip_move;

pub use error::{ConnectionLost, MoveError};
pub use hold_watch::HELD_DEGREES;
pub use joint_move::{JointMove, Targets};
pub use observer::{Observer, Stage};
pub use pace::{Pace, PaceBefore};
pub use park::{PARK_POSE, ParkError, park_way};
pub use player::Player;
pub use recorder::{RecordedPose, Recorder};
pub use tip_move::{GuardedMoveError, LineStart, LineStartError, TipMove};

#[cfg(test)]
mod tests;
