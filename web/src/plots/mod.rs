//! Plots of the last seconds on a canvas: angle, load and velocity of joints 1 to 7.
//!
//! ```text
//!   Sample ──▶ History ──▶ draw(Plot) ──▶ canvas 2D
//!                              ▲
//!               ValueAxis: round numbers
//! ```

pub mod axis;
pub mod draw;
pub mod history;

pub use draw::{Plot, draw, legend_height};
pub use history::{History, PlottedQuantity, Sample};
