//! The options of the exchange with an arm: baud rate, timeout, attempts and register map.

use std::time::Duration;

use protocol_core::registers::map21::Map;

/// Baud rate, timeout, attempts and register map.
///
/// ```
/// use sevenbot::ArmOptions;
/// use std::time::Duration;
///
/// let patient = ArmOptions { reply_timeout: Duration::from_secs(2), ..ArmOptions::default() };
/// assert_eq!(patient.baud, 115_200);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ArmOptions {
    /// Baud rate of the port. The arm starts with the rate in its register 12.
    pub baud: u32,
    /// The timeout of one attempt. A read fails after `attempts` times this.
    pub reply_timeout: Duration,
    /// Attempts for a read, at least one. With more than one, a read is sent again whenever its reply is overdue or damaged, so a lost
    /// reply costs much less than `reply_timeout`: [`Patience`](host_link::Patience). A read changes nothing, so repeating it is
    /// safe.
    pub attempts: u32,
    /// The register map of the frames; `None`: the map that belongs to the arm's firmware version.
    pub map: Option<Map>,
}

impl Default for ArmOptions {
    fn default() -> Self {
        Self { baud: 115_200, reply_timeout: Duration::from_millis(500), attempts: 3, map: None }
    }
}
