//! Writes that the arm has to confirm before a movement or a program goes on.

use protocol_core::time::Instant;

use crate::client::Client;

/// The number of attempts to write registers before a mismatch is an error.
const ATTEMPTS: u32 = 5;

/// The registers did not have the written values after the last attempt.
#[derive(Debug)]
pub(crate) struct Unconfirmed;

/// Writes that are repeated until a later read shows their values.
#[derive(Debug)]
pub(crate) struct Confirmed {
    frames: Vec<(u8, Vec<u8>)>,
    written: Instant,
    attempts: u32,
}

impl Confirmed {
    pub(crate) fn write(frames: Vec<(u8, Vec<u8>)>, now: Instant, client: &mut Client) -> Self {
        let times = frames.iter().map(|(address, values)| client.write(now, *address, values));
        let written = times.last().unwrap_or(now);
        Self { frames, written, attempts: 1 }
    }

    /// Returns `Ok(true)` when a later read has shown the written values, and `Ok(false)` before. If a read shows other values,
    /// writes again, at most [`ATTEMPTS`] times in all.
    pub(crate) fn poll(&mut self, now: Instant, client: &mut Client) -> Result<bool, Unconfirmed> {
        if !client.was_read_since(self.written) {
            return Ok(false);
        }
        let registers = client.registers();
        let is_taken = |(address, values): &(u8, Vec<u8>)| {
            (*address..=u8::MAX).zip(values).all(|(address, value)| registers.at(address) == *value)
        };
        if self.frames.iter().all(is_taken) {
            return Ok(true);
        }
        if self.attempts >= ATTEMPTS {
            return Err(Unconfirmed);
        }
        let attempts = self.attempts + 1;
        *self = Self { attempts, ..Self::write(std::mem::take(&mut self.frames), now, client) };
        Ok(false)
    }
}

pub(crate) fn write_all(frames: &[(u8, Vec<u8>)], now: Instant, client: &mut Client) {
    for (address, values) in frames {
        client.write(now, *address, values);
    }
}
