//! One operation on the registers: a read or a write. It does not know how requests are framed.

/// A read or a write of consecutive bytes of the register map.
pub(crate) struct RegisterOperation {
    /// Address of the first byte.
    pub(crate) first: u8,
    /// Number of bytes.
    pub(crate) count: u8,
    /// The values of a write; empty in a read.
    pub(crate) written: Vec<u8>,
}

impl RegisterOperation {
    pub(crate) const fn read(first: u8, count: u8) -> Self {
        Self { first, count, written: Vec::new() }
    }

    pub(crate) fn write(first: u8, written: Vec<u8>) -> Self {
        Self { first, count: u8::try_from(written.len()).unwrap_or(u8::MAX), written }
    }

    pub(crate) const fn is_read(&self) -> bool {
        self.written.is_empty()
    }

    /// Executes a write.
    pub(crate) fn apply(&self, registers: &mut [u8]) {
        for (register, &value) in registers.iter_mut().skip(usize::from(self.first)).zip(&self.written) {
            *register = value;
        }
    }

    /// The current values of `count` bytes, from the first byte of this operation on.
    pub(crate) fn values(&self, registers: &[u8], count: u8) -> Vec<u8> {
        registers.iter().skip(usize::from(self.first)).take(usize::from(count)).copied().collect()
    }
}
