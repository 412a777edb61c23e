//! The registers of a server that shares an arm, at 232 to 239. The arm has none there: they read 0 without a server. The
//! server fills them in, and its programs read them.
//!
//! ```text
//!   232 layout version   233 clients   234 who drives   235 stops   236 state   237, 238 dropped   239 command
//! ```

use crate::Snapshot;

/// The first register of the server's block.
pub const FIRST: u8 = 232;
/// The register that a program writes commands to.
const COMMAND: u8 = 239;
/// The value of register 232: the version of the layout of this block.
const VERSION: u8 = 1;
/// The largest distance by which a joint droops under its weight from a target that it has reached, in hundredths of a
/// degree. A stop may leave the target of such a joint unchanged ([D24](protocol_core::decisions#d24)). A resting joint
/// that is farther off is at an obstacle.
pub const DROOP: u16 = 150;

/// Are all these registers the server's? `false` for a count of 0.
#[must_use]
pub const fn is_own(address: u8, count: u8) -> bool {
    FIRST <= address && address <= COMMAND && 0 < count && count <= COMMAND - address + 1
}

/// Who wrote targets last, within the last second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum DrivenBy {
    /// No program wrote targets within the last second, or the arm was stopped or handed over since.
    #[default]
    Nobody = 0,
    /// The program that reads.
    This = 1,
    /// Another program.
    Another = 2,
}

impl DrivenBy {
    fn of(value: u8) -> Self {
        [Self::This, Self::Another].into_iter().find(|by| *by as u8 == value).unwrap_or_default()
    }
}

/// What a program writes to register 239.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SharingCommand {
    /// The arm holds where it is.
    Stop = 1,
    /// The program starts anew after another program's stop: the server passes this program's targets on again.
    StartAnew = 2,
    /// The program hands the arm over: another program may drive at once.
    HandOver = 3,
}

impl SharingCommand {
    /// The register, and the value that a program writes there to give this command.
    #[must_use]
    pub const fn write(self) -> (u8, [u8; 1]) {
        (COMMAND, [self as u8])
    }

    /// The command in a write of registers from `address` on; `None` if the write does not cover register 239, or the value
    /// there is no command.
    #[must_use]
    pub fn in_write(address: u8, values: &[u8]) -> Option<Self> {
        let value = *values.get(usize::from(COMMAND.checked_sub(address)?))?;
        [Self::Stop, Self::StartAnew, Self::HandOver].into_iter().find(|command| *command as u8 == value)
    }
}

/// The state of a server, as a program reads it in registers 232 to 238.
///
/// ```
/// use host_link::Snapshot;
/// use host_link::sharing::{DrivenBy, SharingState};
///
/// let read = Snapshot { address: 232, values: vec![1, 2, 2, 5, 1, 0, 0, 0] };
/// let state = SharingState::of(&read).ok_or("a server")?;
/// assert_eq!((state.driven_by, state.is_stopped), (DrivenBy::Another, true));
/// assert_eq!(SharingState::of(&Snapshot { address: 232, values: vec![0; 8] }), None);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SharingState {
    /// Programs that are connected to the server.
    pub clients: u8,
    /// Who wrote targets within the last second.
    pub driven_by: DrivenBy,
    /// Stops of all programs so far, wrapping.
    pub stops: u8,
    /// Did another program's stop end the stream of this program? Then the server drops this program's targets until this
    /// program starts anew.
    pub is_stopped: bool,
    /// Does the server pass no writes on?
    pub is_read_only: bool,
    /// Does the server let only one program at a time drive the arm?
    pub has_one_driver: bool,
    /// Does no arm answer the server?
    pub is_without_arm: bool,
    /// Writes of this program that the server dropped, wrapping.
    pub dropped: u16,
}

impl SharingState {
    /// From registers that a program read; `None` without a server, or from one with another layout.
    #[must_use]
    pub fn of(registers: &Snapshot) -> Option<Self> {
        let [version, clients, driven_by, stops, flags, low, high] =
            [0, 1, 2, 3, 4, 5, 6].map(|place| registers.at(FIRST + place));
        let is_set = |bit: u8| flags >> bit & 1 == 1;
        (version == VERSION).then(|| Self {
            clients,
            driven_by: DrivenBy::of(driven_by),
            stops,
            is_stopped: is_set(0),
            is_read_only: is_set(1),
            has_one_driver: is_set(2),
            is_without_arm: is_set(3),
            dropped: u16::from_le_bytes([low, high]),
        })
    }

    fn bytes(self) -> [u8; 8] {
        let bits = [self.is_stopped, self.is_read_only, self.has_one_driver, self.is_without_arm];
        let flags = (0..).zip(bits).fold(0, |flags, (bit, is_set)| flags | u8::from(is_set) << bit);
        let [low, high] = self.dropped.to_le_bytes();
        [VERSION, self.clients, self.driven_by as u8, self.stops, flags, low, high, 0]
    }

    /// Replaces the registers of the block in the reply to a read from `address` on.
    pub fn overlay(self, address: u8, values: &mut [u8]) {
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
        let read = Snapshot { address: 230, values: values.to_vec() };
        assert_eq!(SharingState::of(&read), Some(state));
    }

    #[test]
    fn a_command_is_found_in_any_write_that_covers_it() {
        for command in [SharingCommand::Stop, SharingCommand::StartAnew, SharingCommand::HandOver] {
            let (address, values) = command.write();
            assert_eq!(SharingCommand::in_write(address, &values), Some(command));
        }
        assert_eq!(SharingCommand::in_write(239, &[1]), Some(SharingCommand::Stop));
        assert_eq!(SharingCommand::in_write(237, &[0, 0, 3, 9]), Some(SharingCommand::HandOver));
        for (address, values) in [(239, &[][..]), (239, &[0]), (238, &[1]), (240, &[1])] {
            assert_eq!(SharingCommand::in_write(address, values), None);
        }
    }
}
