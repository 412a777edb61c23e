//! The numbers of a joint: 1 to 7 for users, 0 to 6 in arrays and register blocks, a bit in sets.

/// Number of joints, and of servos on the bus.
pub const JOINTS: usize = 7;

/// One of the seven joints. Users count from 1 (the base) to 7 (the claw); arrays count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Joint(u8);

impl Joint {
    /// All joints, 1 to 7.
    pub const ALL: [Self; JOINTS] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5), Self(6)];

    /// The joint with the user's number 1 to 7; `None` for any other.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        if number >= 1 && number <= 7 { Some(Self(number - 1)) } else { None }
    }

    /// The joint at position 0 to 6 of an array; `None` for any other.
    #[must_use]
    pub const fn from_index(index: u8) -> Option<Self> {
        if index < 7 { Some(Self(index)) } else { None }
    }

    /// The user's number, 1 to 7.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0 + 1
    }

    /// Position in arrays and in register blocks, 0 to 6.
    #[must_use]
    pub const fn index(self) -> u8 {
        self.0
    }

    /// This joint's bit in a set of joints: bit n-1 is joint n.
    #[must_use]
    pub const fn bit(self) -> u8 {
        1 << self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_are_numbered_from_one() {
        assert_eq!(Joint::new(0), None);
        assert_eq!(Joint::new(8), None);
        assert_eq!(Joint::new(7).map(Joint::index), Some(6));
        assert_eq!(Joint::from_index(7), None);
        let numbers: Vec<u8> = Joint::ALL.iter().map(|joint| joint.number()).collect();
        assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(Joint::ALL.iter().fold(0, |bits, joint| bits | joint.bit()), 0x7F);
    }
}
