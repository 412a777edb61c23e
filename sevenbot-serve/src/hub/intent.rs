//! What a write does to the arm's motion. The intent decides whether the write may wait, and who may send it.

use protocol_core::registers::map::{FINE_TARGET, MOTOR_STATE, TARGET_POSITION, VACUUM_PUMP, motor_state};
use protocol_core::registers::map21::{DISC_DIRECTION, TIP_POSITION, WRIST_POSITION};
use protocol_core::registers::{JOINTS, Map, Register};

use super::own_registers::covers;
use super::readings::Readings;
use protocol_core::time::Instant;

/// A hold of fewer joints is not a stop of the arm: a program may hold one joint while others move.
const STOP_JOINTS: usize = 3;

/// What a write does to the arm's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Intent {
    /// Nothing: settings, speeds, reports.
    Setting,
    /// It switches something: the motors on, the effector, the pump.
    Switch,
    Motion,
    /// It holds joints: their targets are the positions that its client has read.
    Hold,
    /// As `Hold`, with at least [`STOP_JOINTS`] joints, so it is a stop of the arm.
    Stop,
    /// It switches the motors to damping or forceless.
    MotorsOff,
}

impl Intent {
    /// The intent of a write from a client that has read the positions in `readings`.
    pub(crate) fn of(now: Instant, map: Map, address: u8, values: &[u8], readings: &Readings) -> Self {
        let covers = |row: &Register| covers(row, address, values.len());
        let state = byte_at(MOTOR_STATE.address, address, values);
        if matches!(state, Some(motor_state::DAMPING | motor_state::FORCELESS)) {
            return Self::MotorsOff;
        }
        let has_targets = covers(&TARGET_POSITION) || covers(&FINE_TARGET);
        let solves = map == Map::V21 && [TIP_POSITION, WRIST_POSITION, DISC_DIRECTION].iter().any(covers);
        if !has_targets && !solves {
            let switches = state.is_some()
                || (MOTOR_STATE.address..=VACUUM_PUMP.address)
                    .any(|register| byte_at(register, address, values).is_some());
            return if switches { Self::Switch } else { Self::Setting };
        }
        match readings.held_joints(now, address, values) {
            Some(STOP_JOINTS..) if !solves => Self::Stop,
            Some(_) if !solves => Self::Hold,
            _ => Self::Motion,
        }
    }

    /// Does it do harm when it comes late?
    pub(crate) const fn must_be_fresh(self) -> bool {
        !matches!(self, Self::Setting | Self::MotorsOff)
    }

    /// Does it go before everything else?
    pub(crate) const fn is_urgent(self) -> bool {
        matches!(self, Self::Hold | Self::Stop | Self::MotorsOff)
    }

    /// Does it hold the joints that have a target in it?
    pub(crate) const fn holds(self) -> bool {
        matches!(self, Self::Hold | Self::Stop)
    }

    /// Does it end the streams of other clients?
    pub(crate) const fn ends_streams(self) -> bool {
        matches!(self, Self::Stop | Self::MotorsOff)
    }

    pub(crate) const fn is_ended_by_stop(self) -> bool {
        matches!(self, Self::Motion | Self::Switch)
    }
}

fn byte_at(register: u8, address: u8, values: &[u8]) -> Option<u8> {
    values.get(usize::from(register.checked_sub(address)?)).copied()
}

const _: () = assert!(STOP_JOINTS <= JOINTS);

#[cfg(test)]
mod tests {
    use super::*;

    fn of(map: Map, address: u8, values: &[u8]) -> Intent {
        let mut readings = Readings::default();
        readings.note(Instant::ZERO, 54, &[90, 91, 65, 90, 90, 90, 80]);
        readings.note(Instant::ZERO, 142, &[0x28, 0x23, 0xFF, 0xFF]);
        Intent::of(Instant::ZERO, map, address, values, &readings)
    }

    #[test]
    fn targets_that_are_the_positions_read_before_are_a_stop() {
        assert_eq!(of(Map::V22, 46, &[90, 91, 65, 90, 90, 90, 80]), Intent::Stop);
        assert_eq!(of(Map::V21, 48, &[65, 90, 90]), Intent::Stop);
        assert_eq!(of(Map::V22, 46, &[90]), Intent::Hold);
        assert_eq!(of(Map::V22, 128, &[0x28, 0x23]), Intent::Hold);
        assert_eq!(of(Map::V22, 128, &[0x28, 0x23, 0xFF, 0xFF]), Intent::Motion, "not measured");
        assert_eq!(of(Map::V22, 46, &[90, 91, 65, 90, 90, 90, 81]), Intent::Motion);
        for state in [0, 2] {
            assert_eq!(of(Map::V22, 29, &[state]), Intent::MotorsOff);
        }
    }

    #[test]
    fn other_writes_move_switch_or_do_neither() {
        assert_eq!(of(Map::V22, 29, &[1]), Intent::Switch);
        assert_eq!(of(Map::V22, 31, &[1]), Intent::Switch);
        assert_eq!(of(Map::V22, 40, &[0; 7]), Intent::Motion, "its last value is a target");
        assert_eq!(of(Map::V22, 39, &[0; 7]), Intent::Setting);
        assert_eq!(of(Map::V22, 54, &[0; 7]), Intent::Setting, "read only in map 2.2");
        assert_eq!(of(Map::V21, 54, &[0; 7]), Intent::Motion, "a position");
        assert_eq!(of(Map::V21, 68, &[0; 6]), Intent::Motion);
        assert_eq!(of(Map::V22, 0, &[]), Intent::Setting);
    }
}
