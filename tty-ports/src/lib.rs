//! Non-blocking terminals: pseudo-terminals that a program offers to others, and serial ports that it opens.
//!
//! Linux only: counting clients needs inotify and `/proc`, and the lock of a link is an abstract socket.
//!
//! ```
//! use tty_ports::pty::Pty;
//!
//! let port = Pty::open(None)?;
//! println!("a program can open {}", port.path().display());
//! let mut bytes = [0; 64];
//! assert_eq!(port.read(&mut bytes)?, 0, "nothing was sent yet, and the call does not wait");
//! # Ok::<(), std::io::Error>(())
//! ```

#![deny(unsafe_code)]

pub mod clients;
mod holders;
pub mod pty;
pub mod serial;
pub mod symlink;
