//! The simulator: many arms, its control socket and its document.

mod control;
mod document;
mod many_arms;
mod snapshot;
