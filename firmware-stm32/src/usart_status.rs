//! Bits of USART_SR (RM0090, section 30.6.1).

/// PE: wrong parity.
pub const PARITY: u16 = 1 << 0;
/// FE: the stop bit was missing.
pub const FRAMING: u16 = 1 << 1;
/// NF: the samples of a bit differed.
pub const NOISE: u16 = 1 << 2;
/// ORE: a byte was lost behind the one in the data register.
pub const OVERRUN: u16 = 1 << 3;
/// RXNE: a byte is ready to be read.
pub const RECEIVED: u16 = 1 << 5;
/// TC: the last stop bit has left.
pub const COMPLETE: u16 = 1 << 6;
/// TXE: the data register takes a byte.
pub const EMPTY: u16 = 1 << 7;
/// The byte in the data register is damaged.
pub const DAMAGED: u16 = PARITY | FRAMING | NOISE;
/// All receive errors.
pub const ERRORS: u16 = DAMAGED | OVERRUN;
