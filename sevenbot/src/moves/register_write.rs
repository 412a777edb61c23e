//! Writes of any registers. A write that moves the arm gets the checks of a move, before and after it.

use protocol_core::registers::Joint;
use protocol_core::registers::map::{FINE_TARGET, MOTOR_STATE, TARGET_POSITION, motor_state};
use protocol_core::registers::map21::WRIST_POSITION;

use super::error::MoveError;
use crate::arm::Arm;
use crate::health::MoveCheck;
use crate::joints::bits;
use host_link::Span;

/// The position of the wrist sets the targets of joints 1 to 3.
const WRIST_JOINTS: u8 = 3;

impl Arm {
    /// As [`Arm::write_checked`], for registers that a user names. `unlocks` opens the EEPROM lock for this write.
    ///
    /// - A target of a joint that is driven is a move: it is not written while the joint is silent or has let go, and the arm is
    ///   checked after the write. A whole position of the wrist sets the targets of joints 1 to 3
    ///   ([M7](protocol_core::decisions#m7)).
    /// - Motor state 1 is not written while no servo answers. If register 29 is the only one, this is
    ///   [`Arm::engage_and_watch`].
    ///
    /// ```
    /// use sevenbot::moves::MoveError;
    /// use sevenbot::simulated::{self, SimulationConfig};
    /// use sevenbot::{Joint, map};
    /// use std::time::Duration;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let (mut arm, simulation) = simulated::arm(SimulationConfig::default())?;
    /// arm.set_registers(map::TARGET_POSITION.address, &[100], false)?;
    /// simulation.with(|arm| arm.plant_mut().set_fault(Joint::ALL[0], "missing".parse().ok()));
    /// arm.sleep(Duration::from_secs(1));
    /// let silent = arm.set_registers(map::TARGET_POSITION.address, &[90], false);
    /// assert!(matches!(silent, Err(MoveError::Problems(_))));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of [`Arm::write_checked`], of [`Arm::engage_and_watch`] and, for a move, of [`MoveCheck::begin`].
    pub fn set_registers(&mut self, address: u8, values: &[u8], unlocks: bool) -> Result<(), MoveError> {
        let span = Span::of_values(address, values).unwrap_or(Span::NONE);
        if span == Span::of(&MOTOR_STATE) && values == [motor_state::SERVO] {
            return self.engage_and_watch();
        }
        let mut written = span.addresses().zip(values);
        if written.any(|(address, &value)| MOTOR_STATE.holds(address) && value == motor_state::SERVO) {
            self.some_servo_answers()?;
        }
        let joints = joints_with_target(span);
        let is_move = joints != 0 && self.joints()?.is_driven();
        let mut check = is_move.then(|| MoveCheck::begin(self, joints)).transpose()?;
        let write = |arm: &mut Self| arm.write_checked(address, values);
        if unlocks { self.with_open_lock(write) } else { write(self) }?;
        check.as_mut().map(|check| check.check(self)).transpose()?;
        Ok(())
    }
}

/// The joints whose targets a write of the span sets, as [`Joint::bit`]s. No write of an [`Arm`] covers a whole position of the
/// tip: map 2.2 has other registers there.
fn joints_with_target(span: Span) -> u8 {
    let holds =
        |first: u8, count: u8| span.addresses().any(|address| (first..first + count).contains(&address));
    let has_wrist = Span::of(&WRIST_POSITION).addresses().all(|address| holds(address, 1));
    let is_target = |joint: &Joint| {
        let is_of_wrist = has_wrist && joint.number() <= WRIST_JOINTS;
        is_of_wrist || holds(TARGET_POSITION.of(*joint), 1) || holds(FINE_TARGET.of(*joint), 2)
    };
    bits(Joint::ALL.into_iter().filter(is_target))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_joints_of_a_span_are_those_with_a_target_in_it() {
        let joints = |address, count| joints_with_target(Span::new(address, count).expect("a span"));
        assert_eq!(joints_with_target(Span::of(&TARGET_POSITION)), 0x7F);
        assert_eq!((joints(29, 18), joints(52, 3), joints(53, 7)), (1, 0x40, 0));
        assert_eq!((joints(130, 2), joints(131, 2), joints(142, 4)), (0b10, 0b110, 0));
        assert_eq!((joints(68, 6), joints(66, 10), joints(68, 5)), (0b111, 0b111, 0), "M7");
    }
}
