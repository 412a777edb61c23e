//! Positions in hundredths of a degree, velocities and loads, as the extended block shows them (D21).

use protocol_core::registers::Register;
use protocol_core::registers::map::{FINE_POSITION, LOAD, VELOCITY};

use crate::fine_angle::FineAngle;
use host_link::{Snapshot, Span};

/// Targets in hundredths of a degree, joint 1 first; `None` for joints that keep theirs.
pub type FineTargets = [Option<FineAngle>; 7];

/// Positions, velocities and loads at one instant, joint 1 first.
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut arm = sevenbot::Arm::open("/dev/ttyUSB0", 115_200)?;
/// if arm.has_extended_block()? {
///     println!("{:?}", arm.fine_state()?.velocities);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FineState {
    /// The measured positions; `None` for a joint that was not measured since power-up.
    pub positions: FineTargets,
    /// The velocities in 0.1 degrees/s, positive towards greater angles.
    pub velocities: [i16; 7],
    /// The loads in 0.1 % of the stall torque, positive if the motor pushes towards greater angles.
    pub loads: [i16; 7],
}

impl FineState {
    /// The registers of a state: 142 to 183.
    pub const REGISTERS: Span = Span::between(&FINE_POSITION, &LOAD);

    /// From a read of [`Self::REGISTERS`]. Registers that the snapshot lacks count as 0.
    #[must_use]
    pub fn new(snapshot: &Snapshot) -> Self {
        let signed = |row: &Register| snapshot.words(row).map(u16::cast_signed);
        Self {
            positions: snapshot.words(&FINE_POSITION).map(FineAngle::from_hundredths),
            velocities: signed(&VELOCITY),
            loads: signed(&LOAD),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_has_signs_and_unmeasured_joints() {
        let mut values = vec![0; 42];
        values[0..4].copy_from_slice(&[0xFF, 0xFF, 0x28, 0x23]);
        values[14..16].copy_from_slice(&[0xFB, 0xFF]);
        values[40..42].copy_from_slice(&[0x1C, 0x01]);
        let state = FineState::new(&Snapshot { address: 142, values });
        assert_eq!(state.positions[..2], [None, FineAngle::from_hundredths(9000)]);
        assert_eq!((state.velocities[0], state.loads[6]), (-5, 284));
    }
}
