//! The simulator: many arms, the control socket, snapshots, and the commands of its document.

mod control;
mod document;
mod many_arms;
mod snapshot;
