//! The identity of a client.

/// Identifies a client of the hub. A new client gets the next number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ClientId(u32);

impl ClientId {
    /// The id of the client after this one.
    pub(crate) const fn next(self) -> Self {
        Self(self.0.wrapping_add(1))
    }
}
