//! The registers of the server itself, at 232 to 239. The arm has none there: they read 0 without a server.
//!
//! ```text
//!   232 layout version   233 clients   234 who drives   235 stops   236 state   237, 238 dropped   239 command
//! ```

/// The first register.
const FIRST: u8 = 232;
/// The register that a client writes commands to.
const COMMAND: u8 = 239;
/// The version of this layout.
const VERSION: u8 = 1;

/// Are all these registers the server's?
pub(crate) const fn is_own(address: u8, count: u8) -> bool {
    FIRST <= address && address <= COMMAND && 0 < count && count <= COMMAND - address + 1
}

/// Who wrote targets last, within the last second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum DrivenBy {
    /// Nobody.
    #[default]
    Nobody = 0,
    /// The client that reads.
    This = 1,
    /// Another client.
    Another = 2,
}

/// What a client writes to register 239.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Command {
    /// 1: the arm holds where it is.
    Stop,
    /// 2: the client starts anew after a stop.
    StartAnew,
    /// 3: the client hands the arm over.
    HandOver,
}

impl Command {
    /// The command in a write of registers from `address` on.
    pub(crate) fn in_write(address: u8, values: &[u8]) -> Option<Self> {
        match values.get(usize::from(COMMAND.checked_sub(address)?))? {
            1 => Some(Self::Stop),
            2 => Some(Self::StartAnew),
            3 => Some(Self::HandOver),
            _ => None,
        }
    }
}

/// What a client reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SharingState {
    /// Clients of the server.
    pub clients: u8,
    /// Who drives.
    pub driven_by: DrivenBy,
    /// Stops of all clients so far, wrapping.
    pub stops: u8,
    /// A stop of another client ended what this one streams.
    pub is_stopped: bool,
    /// Writes do not reach the arm.
    pub is_read_only: bool,
    /// Only one client drives at a time.
    pub has_one_driver: bool,
    /// No arm answers.
    pub is_without_arm: bool,
    /// Writes of this client that were not carried out, wrapping.
    pub dropped: u16,
}

impl SharingState {
    fn bytes(self) -> [u8; 8] {
        let bits = [self.is_stopped, self.is_read_only, self.has_one_driver, self.is_without_arm];
        let flags = (0..).zip(bits).fold(0, |flags, (bit, is_set)| flags | u8::from(is_set) << bit);
        let [low, high] = self.dropped.to_le_bytes();
        [VERSION, self.clients, self.driven_by as u8, self.stops, flags, low, high, 0]
    }

    /// Replaces the registers of the block in the reply to a read from `address` on.
    pub(crate) fn overlay(self, address: u8, values: &mut [u8]) {
        for (own, byte) in (FIRST..).zip(self.bytes()) {
            let place = own.checked_sub(address).and_then(|place| values.get_mut(usize::from(place)));
            if let Some(value) = place {
                *value = byte;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_own_registers_are_those_of_the_block() {
        for (address, count, wanted) in [
            (232, 8, true),
            (239, 1, true),
            (231, 2, false),
            (239, 2, false),
            (236, 0, false),
            (240, 1, false),
        ] {
            assert_eq!(is_own(address, count), wanted, "{address}+{count}");
        }
    }

    #[test]
    fn the_block_replaces_its_own_registers_only() {
        let state = SharingState {
            clients: 3,
            driven_by: DrivenBy::Another,
            stops: 9,
            is_stopped: true,
            has_one_driver: true,
            dropped: 0x0102,
            ..SharingState::default()
        };
        let mut values = [0xEE; 12];
        state.overlay(230, &mut values);
        assert_eq!(values, [0xEE, 0xEE, 1, 3, 2, 9, 5, 2, 1, 0, 0xEE, 0xEE]);
        let mut tail = [0xEE; 3];
        state.overlay(238, &mut tail);
        assert_eq!(tail, [1, 0, 0xEE]);
    }

    #[test]
    fn a_command_is_found_in_any_write_that_covers_it() {
        assert_eq!(Command::in_write(239, &[1]), Some(Command::Stop));
        assert_eq!(Command::in_write(237, &[0, 0, 3, 9]), Some(Command::HandOver));
        for (address, values) in [(239, &[][..]), (239, &[0]), (238, &[1]), (240, &[1])] {
            assert_eq!(Command::in_write(address, values), None);
        }
    }
}
