//! Kinematics of a 7Bot V2 arm: joint angles to positions in millimetres, and back.
//!
//! ```text
//!   [T1 .. T6] ──▶ forward ──▶ Frames: every point and direction of the arm
//!
//!   wrist ──────────────────▶ ik5 ──▶ [T1 .. T3]
//!   tip, tool ──────────────▶ ik6 ──▶ [T1 .. T5]     or NoSolution: why not
//!   tip, tool, disc ────────▶ ik7 ──▶ [T1 .. T6]
//!
//!   point out of reach ─────▶ nearest ──▶ the nearest point within reach
//!   [T1 .. T5] ─────────────▶ workspace ──▶ the smallest distance from the table or the base
//! ```
//!
//! T1 to T7 are the angles of joints 1 to 7 in degrees, as the registers have them. T7, the claw, moves no point.
//! Positions are millimetres from where the base axis meets the top plate: x to the right, y forward, z up.
//!
//! The functions are generic over `f32` for the chip and `f64` for the host, except those of [`workspace`], which only
//! hosts need. They use only exactly rounded operations and `libm`, so all machines get the same bits. The crate uses no
//! heap. It has no unsafe code and no path to a panic.
//!
//! ```
//! use kinematics::{NoSolution, Vector, forward, ik6};
//!
//! let angles = [120.0, 80.0, 60.0, 90.0, 100.0, 90.0];
//! let hand = forward(angles).hand;
//! let found = ik6(hand.tip, hand.tool)?;
//! assert!(found.iter().zip(angles).all(|(found, angle): (&f64, f64)| (found - angle).abs() < 1e-9));
//!
//! let far = ik6(Vector::new(0.0, 900.0, 0.0), hand.tool);
//! assert!(far.is_err());
//! # Ok::<(), NoSolution>(())
//! ```

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod branches;
mod float;
pub mod forward;
pub mod geometry;
pub mod inverse;
pub mod limits;
pub mod nearest;
mod vector;
pub mod workspace;

pub use branches::{ik5_all, ik6_all};
pub use float::Float;
pub use forward::{Frames, forward};
pub use inverse::{NoSolution, ik5, ik6, ik7};
pub use vector::Vector;
pub use workspace::{Clearance, FixedObstacle, Part, Workspace};
