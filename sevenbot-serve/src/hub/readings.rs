//! The positions that a client has read lately. A write of targets that equal them holds the arm. Programs stop the arm in this
//! way (`sevenbot::hold`), because the protocol has no request to stop. A joint that was read near its target may keep that
//! target.

use std::collections::VecDeque;

use host_link::keep_limits;
use host_link::sharing::DROOP;
use protocol_core::registers::map::{FINE_POSITION, FINE_TARGET, PRESENT_POSITION, TARGET_POSITION};
use protocol_core::registers::{JOINTS, Register};
use protocol_core::time::{Duration, Instant};

use super::angles::{UNMEASURED, angles_in, limits_in};

/// Number of readings that are kept. A client may read again before it writes the positions of an earlier reading.
const KEPT: usize = 8;
/// Readings older than this no longer tell where the arm is.
const FRESH: Duration = Duration::from_millis(1_000);

/// A reply or a report that holds positions.
#[derive(Debug)]
struct PositionReading {
    at: Instant,
    address: u8,
    values: Vec<u8>,
}

/// The last readings of a client.
#[derive(Debug, Default)]
pub(crate) struct Readings(VecDeque<PositionReading>);

impl Readings {
    /// Notes that the client got these values. Keeps them only if they hold positions.
    pub(crate) fn note(&mut self, now: Instant, address: u8, values: &[u8]) {
        let holds = |row| angles_in(row, address, values).iter().any(Option::is_some);
        if !holds(&PRESENT_POSITION) && !holds(&FINE_POSITION) {
            return;
        }
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(PositionReading { at: now, address, values: values.to_vec() });
    }

    /// The number of joints that a write holds; `None` if it has no targets, or sends a joint to another position than the
    /// client has read.
    pub(crate) fn held_joints(&self, now: Instant, address: u8, values: &[u8]) -> Option<usize> {
        let fresh = self.0.iter().rev().take_while(|reading| now - reading.at < FRESH);
        let held = |reading: &PositionReading| {
            let coarse = reading.held(&TARGET_POSITION, &PRESENT_POSITION, address, values)?;
            Some(coarse + reading.held(&FINE_TARGET, &FINE_POSITION, address, values)?)
        };
        fresh.filter_map(held).max().filter(|&joints| joints > 0)
    }
}

impl PositionReading {
    /// The number of joints whose target in the write is the position of this reading; `None` if a joint has another
    /// target. A joint may also keep the fine target that this reading shows, within [`DROOP`] of its position. If the reading
    /// has the limits (register 188), fine positions are kept within them.
    fn held(&self, targets: &Register, positions: &Register, address: u8, values: &[u8]) -> Option<usize> {
        let written = angles_in(targets, address, values);
        let [present, measured] = [targets, positions].map(|row| angles_in(row, self.address, &self.values));
        let is_fine = positions == &FINE_POSITION;
        let mut held = [None; JOINTS];
        for (((held, target), present), position) in held.iter_mut().zip(written).zip(present).zip(measured) {
            let Some(target) = target else { continue };
            let position = position?;
            let is_kept = is_fine && present == Some(target) && target.abs_diff(position) <= DROOP;
            *held = Some(if is_kept { target } else { position }).filter(|&held| held != UNMEASURED);
        }
        let limits = if is_fine { limits_in(self.address, &self.values) } else { 0 };
        keep_limits(limits, &present.map(Option::unwrap_or_default), &mut held);
        (held == written).then(|| written.into_iter().flatten().count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol_core::registers::map::LIMITS;

    const POSE: [u8; 7] = [10, 20, 30, 40, 50, 60, 70];

    fn at_ms(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    #[test]
    fn one_of_the_last_readings_has_to_hold_all_targets() {
        let mut readings = Readings::default();
        assert_eq!(readings.held_joints(at_ms(0), 46, &POSE), None);
        readings.note(at_ms(0), 54, &POSE);
        readings.note(at_ms(10), 54, &[11, 20, 30, 40, 50, 60, 70]);
        assert_eq!(readings.held_joints(at_ms(20), 46, &POSE), Some(7), "the one before");
        assert_eq!(readings.held_joints(at_ms(20), 46, &[11]), Some(1));
        assert_eq!(readings.held_joints(at_ms(20), 46, &[12]), None);
        assert_eq!(readings.held_joints(at_ms(999), 46, &POSE), Some(7));
        assert_eq!(readings.held_joints(at_ms(1_000), 46, &POSE), None, "too old");
        assert_eq!(readings.held_joints(at_ms(20), 32, &POSE), None, "no targets");
        (0..8).for_each(|_| readings.note(at_ms(20), 60, &[1]));
        assert_eq!(readings.held_joints(at_ms(20), 46, &POSE), None, "forgotten");
        assert_eq!(readings.held_joints(at_ms(20), 52, &[1]), Some(1));
    }

    #[test]
    fn a_joint_that_was_near_its_target_may_keep_it() {
        let reading = |position: u16| {
            let mut readings = Readings::default();
            let values = [9_000_u16, 0, 0, 0, 0, 0, 0, position].map(u16::to_le_bytes).concat();
            readings.note(at_ms(0), 128, &values);
            readings
        };
        let held =
            |readings: &Readings, target: u16| readings.held_joints(at_ms(0), 128, &target.to_le_bytes());
        assert_eq!(held(&reading(8_900), 9_000), Some(1));
        assert_eq!(held(&reading(8_900), 8_900), Some(1));
        assert_eq!(held(&reading(8_900), 8_950), None, "neither of them");
        assert_eq!(held(&reading(8_800), 9_000), None, "it is on its way");
    }

    #[test]
    fn d25_a_stop_within_the_limits_is_a_stop() {
        let mut readings = Readings::default();
        let (targets, positions) = ([9_000, 7_600, 15_000], [9_500, 12_900, 9_900]);
        let mut values = vec![0; usize::from(LIMITS.address - 128) + 1];
        values[..6].copy_from_slice(&targets.map(u16::to_le_bytes).concat());
        values[14..20].copy_from_slice(&positions.map(u16::to_le_bytes).concat());
        let held = |readings: &Readings, joint_2: u16| {
            readings.held_joints(at_ms(0), 128, &[9_500, joint_2, 9_900].map(u16::to_le_bytes).concat())
        };
        readings.note(at_ms(0), 128, &values);
        assert_eq!((held(&readings, 12_900), held(&readings, 12_700)), (Some(3), None));
        *values.last_mut().unwrap_or(&mut 0) = 1;
        readings.note(at_ms(0), 128, &values);
        assert_eq!(held(&readings, 12_700), Some(3), "the sum of joints 2 and 3 is 226 degrees");
    }
}
