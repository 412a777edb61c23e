//! The text of `docs/protocol.md`, with the decisions D1 to D30 and M1 to M12 that comments cite: `(D5)` is
//! [D5](crate::decisions#d5).
#![doc = include_str!("../protocol.md")]
