//! Where an arm is: in this tab, behind a server, or on this computer's USB.
//!
//! A source carries bytes. It does not know frames.

#[cfg(target_arch = "wasm32")]
pub mod serial;
pub mod simulator;
#[cfg(target_arch = "wasm32")]
pub mod socket;

/// What a source can say of its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LineState {
    /// It is being opened.
    Opening,
    /// Bytes pass.
    Open,
    /// It failed, or was closed, with the reason in the browser's words.
    Closed(String),
}

/// A line to an arm.
pub trait Source {
    /// Sends bytes. They are lost while the line is not open.
    fn send(&mut self, bytes: &[u8]);

    /// The bytes that have arrived since the last call.
    fn receive(&mut self) -> Vec<u8>;

    /// The state of the line.
    fn state(&self) -> LineState;
}
