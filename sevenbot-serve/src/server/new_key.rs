//! Where the server gets secrets from.

/// Makes a secret that was never used before; `None` if the system has no random numbers.
pub type NewKey = fn() -> Option<String>;
