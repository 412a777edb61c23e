//! Terminals without blocking: pseudo-terminals that a program offers to others, and serial ports that it opens.
//!
//! Linux only, because inotify reports when clients open and close a pseudo-terminal.

#![deny(unsafe_code)]

pub mod clients;
mod holders;
pub mod pty;
pub mod serial;
pub mod symlink;
