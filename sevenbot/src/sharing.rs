//! What a server that shares an arm tells each of its programs: registers 232 to 239 (docs/serve.md). Without a server they
//! read 0.

use crate::Snapshot;

/// The first register of a server.
pub const FIRST: u8 = 232;
/// Register 239 and the value that starts anew after a stop of another program.
pub const START_ANEW: (u8, [u8; 1]) = (239, [2]);

/// The layout that this library knows.
const LAYOUT: u8 = 1;
const DRIVEN_BY: u8 = 234;
const BY_ANOTHER: u8 = 2;
const STATE: u8 = 236;
const IS_STOPPED: u8 = 1;

/// How an arm is shared, as the program that reads sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sharing {
    /// Another program wrote targets last, within a second.
    pub another_drives: bool,
    /// A stop of another program ended what this one streams: its targets are dropped until it starts anew.
    pub is_stopped: bool,
}

impl Sharing {
    /// From registers; `None` without a server.
    ///
    /// ```
    /// use sevenbot::Snapshot;
    /// use sevenbot::sharing::Sharing;
    ///
    /// let read = Snapshot { address: 232, values: vec![1, 2, 2, 5, 1, 0, 0, 0] };
    /// assert_eq!(Sharing::of(&read), Some(Sharing { another_drives: true, is_stopped: true }));
    /// assert_eq!(Sharing::of(&Snapshot { address: 232, values: vec![0; 8] }), None);
    /// ```
    #[must_use]
    pub fn of(registers: &Snapshot) -> Option<Self> {
        (registers.at(FIRST) == LAYOUT).then(|| Self {
            another_drives: registers.at(DRIVEN_BY) == BY_ANOTHER,
            is_stopped: registers.at(STATE) & IS_STOPPED != 0,
        })
    }
}
