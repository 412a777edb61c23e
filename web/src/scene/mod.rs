//! The arm in 3D: draws a [`View`] with WebGL2, and interprets pointers on the picture.
//!
//! ```text
//!   kinematics ──▶ arm-model ──▶ arm: triangles, pick ──▶ drag ──▶ pointer ──▶ SceneEvent
//!                                 │                                  ▲
//!   View ──▶ lines, arm ──▶ renderer ──▶ pixels ◀── camera ──────────┘
//! ```
//!
//! Positions are millimetres in the frame of the arm: x to the right, y forward, z up. Pixels are CSS pixels from the top
//! left of the canvas. Everything except the renderer and the canvas also runs on the host.

pub mod arm;
pub mod camera;
pub mod canvas;
pub mod drag;
mod lines;
pub mod pointer;
mod renderer;
mod shaders;
pub mod theme;
pub mod things;
pub mod view;

pub use arm::{Angles, ArmPart};
pub use camera::{Camera, Preset};
pub use canvas::ArmScene;
pub use drag::{RefusedWish, TipWish, WishRefusal, wish};
pub use pointer::{Button, SceneEvent};
pub use theme::{Rgb, Theme};
pub use things::things;
pub use view::View;
