//! When and with which registers the maker's firmware solves inverse kinematics.
//!
//! The solver here is exact. Its angles are truncated to whole degrees, as in the maker's firmware. That firmware refuses or
//! misses some poses that this solver reaches.

use kinematics::{ik5, ik6, ik7};
use motion_core::reach::{direction, position};
use protocol_core::registers::map21::{DISC_DIRECTION, TIP_POSITION, TOOL_DIRECTION, WRIST_POSITION};
use protocol_core::registers::{JOINTS, Register};

use super::registers::StockRegisters;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Solver {
    Ik5,
    Ik6,
    Ik7,
}

/// The solvers that writes have requested.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Requested {
    ik5: bool,
    ik6: bool,
    ik7: bool,
}

impl Requested {
    /// Requests the solvers whose registers were written. One byte of a block is enough.
    pub(super) fn note(&mut self, is_written: impl Fn(u8) -> bool) {
        let any = |row: &Register| (0..row.count).any(|index| is_written(row.address + index));
        self.ik5 |= any(&WRIST_POSITION);
        self.ik6 |= any(&TIP_POSITION) || any(&TOOL_DIRECTION);
        self.ik7 |= any(&DISC_DIRECTION);
    }

    /// The solvers to run after a write. With IK7, a request for IK6 stays until the next write, as in the maker's firmware.
    pub(super) fn take(&mut self) -> impl Iterator<Item = Solver> + use<> {
        let ik5 = core::mem::take(&mut self.ik5).then_some(Solver::Ik5);
        let other = if core::mem::take(&mut self.ik7) {
            Some(Solver::Ik7)
        } else {
            core::mem::take(&mut self.ik6).then_some(Solver::Ik6)
        };
        ik5.into_iter().chain(other)
    }
}

impl Solver {
    /// The targets of the joints; `None` without a solution.
    pub(super) fn solve(self, registers: &StockRegisters) -> Option<[Option<u8>; JOINTS]> {
        let tip = position(registers.bytes(TIP_POSITION.address));
        let tool = direction(registers.bytes(TOOL_DIRECTION.address));
        match self {
            Self::Ik5 => {
                ik5(position(registers.bytes(WRIST_POSITION.address))).ok().map(|angles| targets(&angles))
            }
            Self::Ik6 => ik6(tip, tool).ok().map(|angles| targets(&angles)),
            Self::Ik7 => ik7(tip, tool, direction(registers.bytes(DISC_DIRECTION.address)))
                .ok()
                .map(|angles| targets(&angles)),
        }
    }

    /// The type of the alarm if there is no solution. `None`: IK5 fails silently.
    pub(super) const fn alarm(self) -> Option<u8> {
        match self {
            Self::Ik5 => None,
            Self::Ik6 => Some(6),
            Self::Ik7 => Some(7),
        }
    }
}

/// Truncates angles to whole degrees. `None`: the solver has no angle for this joint, so the joint keeps its target.
fn targets(angles: &[f32]) -> [Option<u8>; JOINTS] {
    let mut targets = [None; JOINTS];
    for (target, &angle) in targets.iter_mut().zip(angles) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // 0 to 180: `kinematics` keeps the limits.
        let degrees = angle as u8;
        *target = Some(degrees);
    }
    targets
}
