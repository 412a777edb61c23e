//! The connections to an arm: simulated in this tab, behind a server, or on this computer's USB.
//!
//! A source carries bytes, without knowledge of frames.

#[cfg(target_arch = "wasm32")]
pub mod serial;
pub mod simulator;
#[cfg(target_arch = "wasm32")]
pub mod socket;

/// The state of the line of a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LineState {
    /// The line is being opened: bytes to send are lost.
    Opening,
    /// The line carries bytes in both directions.
    Open,
    /// Opening failed, or the line was closed. Holds the reason that the browser or the server gives; empty if there is none.
    Closed(String),
}

/// A line that carries bytes to and from an arm. Each kind of connection implements it.
pub trait Source {
    /// Sends bytes. They are lost while the line is not open.
    fn send(&mut self, bytes: &[u8]);

    /// Takes the bytes that have arrived since the last call. Never blocks.
    fn receive(&mut self) -> Vec<u8>;

    /// The state of the line now: always [`LineState::Open`] for a simulated arm.
    fn state(&self) -> LineState;
}
